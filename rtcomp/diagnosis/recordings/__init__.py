"""Recordings as the diagnosis takes them: checked, and cut into segments."""
