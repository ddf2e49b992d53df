"""References, PID, feedforward's limits: what turns a motion and a position into a command."""
