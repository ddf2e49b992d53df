"""Fewer points that look the same: peaks, order, ends and gaps stay."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

_MEASURED_ROWS = 200_000
"""Rows at most on which a path's length is measured; longer ones by their peaks."""


def _keep(columns: Sequence[Floats], edges: Indices) -> Indices:
    """Return the indices of the ends and, per bucket, of each column's extremes and of the first gap."""
    kept = {int(edges[0]), int(edges[-1]) - 1}
    for low, high in pairwise(edges):
        if high <= low:
            continue
        gap = high
        for column in columns:
            piece = column[low:high]
            good = np.isfinite(piece)
            if good.all():
                kept.update((int(low + np.argmin(piece)), int(low + np.argmax(piece))))
                continue
            gap = min(gap, int(low + np.argmin(good)))
            where = np.flatnonzero(good)
            if where.size:
                kept.update(
                    (int(low + where[np.argmin(piece[where])]), int(low + where[np.argmax(piece[where])]))
                )
        if gap < high:
            kept.add(int(gap))
    return np.array(sorted(kept), dtype=np.intp)


def _buckets(columns: Sequence[Floats], points: int) -> int:
    count = len(columns)
    if count == 0 or any(len(c) != len(columns[0]) for c in columns):
        raise ValueError("decimation needs at least one column, all of the same length")
    # A bucket gives at most two extremes a column and one gap; the two ends come on top.
    buckets = (points - 2) // (2 * count + 1)
    if buckets < 1:
        raise ValueError(f"{points} points are too few for {count} columns; give at least {2 * count + 3}")
    return buckets


def peak_indices(columns: Sequence[Floats], points: int) -> Indices:
    """Return at most `points` indices, ascending, that draw `columns` against their common row without loss
    of peaks.

    The rows are cut into equal buckets; of each, every column's smallest and largest finite value stay, and
    the first value that is not finite, so that gaps stay gaps. The first and last row always stay. Columns of
    up to `points` rows are returned whole. Raises ValueError where the columns differ in length or `points`
    is too small.
    """
    buckets = _buckets(columns, points)
    rows = len(columns[0])
    if rows <= points:
        return np.arange(rows, dtype=np.intp)
    return _keep(columns, np.linspace(0, rows, buckets + 1).astype(np.intp))


def path_indices(columns: Sequence[Floats], points: int, coarsest: float = 0.05) -> Indices:
    """Return at most `points` indices, ascending, that draw a path (a loop), first column against the others.

    Buckets are equal in length along the path, not in rows, each axis in units of its range, so that a
    reversal is kept as well as the slow middle. Wiggles below a fifth of `coarsest` (noise) count no length.
    Where a bucket would be longer than `coarsest` a path no longer looks like itself (chords across loops);
    then only the last stretch that can be drawn faithfully is returned: the first index says where it begins.
    Raises ValueError as `peak_indices`.
    """
    buckets = _buckets(columns, points)
    rows = len(columns[0])
    if rows <= points:
        return np.arange(rows, dtype=np.intp)
    some = peak_indices(columns, max(_MEASURED_ROWS, points))
    square = np.zeros(len(some) - 1)
    for column in columns:
        piece = column[some]
        finite = piece[np.isfinite(piece)]
        spread = float(np.ptp(finite)) if finite.size else 0.0
        if 0.0 < spread < np.inf:
            square += np.diff(_without_wiggles(piece / spread, coarsest / 5.0)) ** 2
    length = np.concatenate(([0.0], np.cumsum(np.sqrt(square))))
    start = max(0.0, float(length[-1]) - buckets * coarsest)
    edges = some[np.searchsorted(length, np.linspace(start, float(length[-1]), buckets + 1))]
    edges[-1] = rows
    if start == 0.0:
        edges[0] = 0
    return _keep(columns, np.maximum.accumulate(edges))


def _without_wiggles(column: Floats, reach: float) -> Floats:
    """Return the play of half-width `reach` driven by `column`; what is not finite moves nothing."""
    finite = column[np.isfinite(column)]
    at = float(finite[0]) if finite.size else 0.0
    followed = []
    for value in column.tolist():
        if value > at + reach:
            at = value - reach if value < np.inf else at
        elif value < at - reach:
            at = value + reach if value > -np.inf else at
        followed.append(at)
    return np.array(followed)
