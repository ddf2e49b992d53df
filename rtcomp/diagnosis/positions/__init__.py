"""The objective that judges by position: stages let go from points of a recording."""
