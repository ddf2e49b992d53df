"""Diagnosis: where simulation and recording differ, which physics is missing, and how much it explains."""
