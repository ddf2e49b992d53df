"""What chords make of a branch: the error of one, and where two do best. For `placing`."""

from __future__ import annotations

import numpy as np

from rtcomp.hysteresis.moving import places as at
from rtcomp.kernels import Floats, compiled

POINTS = 48
"""Corners of an interval that a look compares at most, so that its time is bounded."""
FINEST = 16.0
"""Intervals get no narrower than the reached range divided by this and by their number."""


@compiled
def chord(p: Floats, m: Floats, low: int, high: int) -> float:
    """Return the square error (N^2 m) of the chord of the branch over the corners `low` to `high`."""
    cells = int(p[at.CELLS])
    x, y = at.EDGES + int(p[at.COUNT]) + 1, at.ARRAYS + 2 * cells
    if high - low < 2:
        return 0.0
    stride = (high - low + POINTS - 1) // POINTS
    slope = (m[y + high] - m[y + low]) / (p[x + high] - p[x + low])
    total = 0.0
    before, c = low, low + stride
    while c < high:
        after = min(c + stride, high)
        off = m[y + c] - m[y + low] - slope * (p[x + c] - p[x + low])
        total += off * off * 0.5 * (p[x + after] - p[x + before])
        before, c = c, after
    return total


@compiled
def best_split(p: Floats, m: Floats, low: int, high: int) -> tuple[float, int]:
    """Return the least square error (N^2 m) of two chords over `low` to `high`, and the corner between.

    Neither part is narrower than learning can tell: infinite, and `low`, where there is no such corner.
    """
    if high - low < 2:
        return np.inf, low
    stride = (high - low + POINTS - 1) // POINTS
    cells = int(p[at.CELLS])
    x, y = at.EDGES + int(p[at.COUNT]) + 1, at.ARRAYS + 2 * cells
    # Sums from the low end, and what is left of them from the high end, at each corner in turn.
    narrow = max(2.0 * m[at.GATE], p[x + int(m[at.DEEPEST])] / (FINEST * p[at.COUNT]))
    syy, sxy, sxx = 0.0, 0.0, 0.0
    tyy, txy, txx = 0.0, 0.0, 0.0
    c = low + stride
    before = low
    while c < high:
        after = min(c + stride, high)
        h = 0.5 * (p[x + after] - p[x + before])
        dx, dy = p[x + c] - p[x + high], m[y + c] - m[y + high]
        tyy += h * dy * dy
        txy += h * dx * dy
        txx += h * dx * dx
        before, c = c, after
    least, best = np.inf, low
    before, c = low, low + stride
    while c < high:
        after = min(c + stride, high)
        h = 0.5 * (p[x + after] - p[x + before])
        dx, dy = p[x + c] - p[x + high], m[y + c] - m[y + high]
        tyy -= h * dy * dy
        txy -= h * dx * dy
        txx -= h * dx * dx
        slope = dy / dx
        right = tyy - 2.0 * slope * txy + slope * slope * txx
        dx, dy = p[x + c] - p[x + low], m[y + c] - m[y + low]
        slope = dy / dx
        left = syy - 2.0 * slope * sxy + slope * slope * sxx
        wide = min(p[x + c] - p[x + low], p[x + high] - p[x + c]) >= narrow
        if wide and max(left, 0.0) + max(right, 0.0) < least:
            least, best = max(left, 0.0) + max(right, 0.0), c
        syy += h * dy * dy
        sxy += h * dx * dy
        sxx += h * dx * dx
        before, c = c, after
    return least, best


@compiled
def of_noise(p: Floats, m: Floats, low: int, high: int) -> float:
    """Return the square error (N^2 m) that the slopes' noise alone gives a chord over `low` to `high`."""
    cells = int(p[at.CELLS])
    x, q = at.EDGES + int(p[at.COUNT]) + 1, at.ARRAYS + 3 * cells + 1
    return float((m[q + high] - m[q + low]) * (p[x + high] - p[x + low]) / 6.0)
