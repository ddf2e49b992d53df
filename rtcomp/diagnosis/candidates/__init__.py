"""Candidates: every effect of the catalogue at likely values, screened, and the best of them fitted."""
