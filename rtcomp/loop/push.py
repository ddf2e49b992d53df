"""The compiled side of the ring: writing a row from inside the tick."""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.loop.ring import WRITTEN


@compiled
def push(header: np.ndarray, rows: Floats, row: Floats) -> None:
    """Write one row: data first, then the count, so that a reader never sees a half-written row as done."""
    place = header[WRITTEN] % rows.shape[0]
    for i in range(row.size):
        rows[place, i] = row[i]
    header[WRITTEN] += 1
