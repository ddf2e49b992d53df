"""The counts of a sensor, as its readings show them: steps of which all changes are multiples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.kernels import Floats

SMALL, FEWEST = 20.0, 10
"""Counts up to which a change tells a multiple in spite of rounding; so many changes at least must do so."""
WHOLE, MOST = 0.1, 0.99
"""Part of a count by which a multiple may be off; part of the changes that must be multiples. Of changes
without counts a fifth would be."""


def count_of(readings: Sequence[Floats]) -> float:
    """Return the count (m) of readings of a position (m, (K,) each), 0.0 where they show none."""
    changes = np.abs(np.concatenate([np.diff(x) for x in readings]))
    largest = max((float(np.abs(x).max()) for x in readings if x.size), default=0.0)
    changes = changes[changes > 16.0 * np.finfo(np.float64).eps * largest]
    if not changes.size:
        return 0.0
    multiples = changes[changes < SMALL * changes.min()] / changes.min()
    whole = np.abs(multiples - np.round(multiples)) < WHOLE
    return float(changes.min()) if whole.size >= FEWEST and np.mean(whole) >= MOST else 0.0
