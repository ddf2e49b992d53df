"""What straight pieces make of a branch: the error of one, and where two do best. For `placing`.

A piece is the straight line of least squares, its ends free: noise in the branch then costs every piece
alike, wherever it begins and ends. Lines through the branch at their ends would carry the noise of those two.
"""

from __future__ import annotations

import numpy as np

from rtcomp.hysteresis.moving import places as at
from rtcomp.kernels import Floats, compiled

POINTS = 48
"""Corners of an interval that a look compares at most, so that its time is bounded."""
FINEST = 16.0
"""Intervals get no narrower than the reached range divided by this and by their number."""


@compiled
def residual(n: float, x: float, y: float, xx: float, xy: float, yy: float) -> float:
    """Return the square error of the line of least squares, from the weighted sums over its points."""
    if not n > 0.0:
        return 0.0
    sxx, sxy, syy = xx - x * x / n, xy - x * y / n, yy - y * y / n
    return max(syy - (sxy * sxy / sxx if sxx > 0.0 else 0.0), 0.0)


@compiled
def stride_of(low: int, high: int) -> int:
    """Return how many corners apart those lie that are compared."""
    return (high - low + POINTS - 1) // POINTS


@compiled
def sums(p: Floats, m: Floats, low: int, high: int) -> tuple[float, float, float, float, float, float]:
    """Return the sums that `residual` takes, over the corners `low` to `high`, from the first of them."""
    cells = int(p[at.CELLS])
    corner, branch = at.EDGES + int(p[at.COUNT]) + 1, at.ARRAYS + 2 * cells
    stride = stride_of(low, high)
    n, x, y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    c = low
    while True:
        before, after = max(c - stride, low), min(c + stride, high)
        h = 0.5 * (p[corner + after] - p[corner + before])
        dx, dy = p[corner + c] - p[corner + low], m[branch + c] - m[branch + low]
        n, x, y = n + h, x + h * dx, y + h * dy
        xx, xy, yy = xx + h * dx * dx, xy + h * dx * dy, yy + h * dy * dy
        if c == high:
            return n, x, y, xx, xy, yy
        c = after


@compiled
def piece(p: Floats, m: Floats, low: int, high: int) -> float:
    """Return the square error (N^2 m) of one straight piece over the corners `low` to `high`."""
    if high - low < 3:
        return 0.0
    n, x, y, xx, xy, yy = sums(p, m, low, high)
    return float(residual(n, x, y, xx, xy, yy))


@compiled
def best_split(p: Floats, m: Floats, low: int, high: int) -> tuple[float, int]:
    """Return the least square error (N^2 m) of two pieces over `low` to `high`, and the corner between.

    Neither part is narrower than learning can tell: infinite, and `low`, where there is no such corner.
    """
    if high - low < 2:
        return np.inf, low
    cells = int(p[at.CELLS])
    corner, branch = at.EDGES + int(p[at.COUNT]) + 1, at.ARRAYS + 2 * cells
    stride = stride_of(low, high)
    narrow = max(2.0 * m[at.GATE], p[corner + int(m[at.DEEPEST])] / (FINEST * p[at.COUNT]))
    # Over all of it; then over what lies before a corner, in turn, and by difference behind it.
    rn, rx, ry, rxx, rxy, ryy = sums(p, m, low, high)
    n, x, y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    least, best, c = np.inf, low, low
    while c < high:
        before, after = max(c - stride, low), min(c + stride, high)
        dx, dy = p[corner + c] - p[corner + low], m[branch + c] - m[branch + low]
        # A corner between two pieces belongs to either by half.
        for side in range(2):
            h = 0.5 * (p[corner + c] - p[corner + before] if side == 0 else p[corner + after] - p[corner + c])
            n, x, y = n + h, x + h * dx, y + h * dy
            xx, xy, yy = xx + h * dx * dx, xy + h * dx * dy, yy + h * dy * dy
            if side == 0 and c > low:
                wide = min(dx, p[corner + high] - p[corner + c]) >= narrow
                left = residual(n, x, y, xx, xy, yy)
                right = residual(rn - n, rx - x, ry - y, rxx - xx, rxy - xy, ryy - yy)
                if wide and left + right < least:
                    least, best = left + right, c
        c = after
    return least, best


@compiled
def of_noise(p: Floats, m: Floats, low: int, high: int) -> float:
    """Return the square error (N^2 m) that the noise of the branch gives one of its corners, on average."""
    if high <= low:
        return 0.0
    cells = int(p[at.CELLS])
    corner, noise = at.EDGES + int(p[at.COUNT]) + 1, at.ARRAYS + 3 * cells + 1
    width = (p[corner + high] - p[corner + low]) / (high - low)
    return float((m[noise + high] - m[noise + low]) / (high - low) * width)
