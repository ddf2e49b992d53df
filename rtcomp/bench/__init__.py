"""What this machine does about deadlines, measured beside plain rivals in the same minutes."""
