"""Recordings: written by a process of their own, read whoever wrote them, converted."""
