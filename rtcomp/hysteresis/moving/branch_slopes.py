"""The slope of a branch in every cell, measured while the axis moves, apart from any weights.

Force over way while the front of the operator passes a cell is the slope of the branch there. It depends on
no interval, so it says where the intervals belong (`placing`) and does not change as they move.
"""

from __future__ import annotations

import numpy as np

from rtcomp.hysteresis.moving import places as at
from rtcomp.kernels import Floats, compiled

MEMORY, NOISE_MEMORY = 400.0, 500.0
"""Passages of a cell, and updates, over which is averaged: friction may drift."""
FRACTION = 0.9
"""Of a way that must have passed cells: beyond saturation it does not."""
_LEAST = 1e-200


@compiled
def filter_slopes(p: Floats, s: Floats, m: Floats, first: int, last: int, off: float) -> None:
    """Correct the slopes of the cells passed by what they did not foresee of the force, `off` (N).

    A Kalman step with a variance of its own for each cell: what is known best is changed least. Variances
    stay above what `MEMORY` passages leave, so that friction may drift.
    """
    cells = int(p[at.CELLS])
    passed, variance = at.AMOUNTS + cells, at.ARRAYS + cells
    corner = at.EDGES + int(p[at.COUNT]) + 1
    spread = m[at.STEP_NOISE] + _LEAST
    for c in range(first, last + 1):
        spread += s[passed + c] * s[passed + c] * m[variance + c]
    for c in range(first, last + 1):
        gain = s[passed + c] * m[variance + c] / spread
        if gain > 0.0:
            m[at.ARRAYS + c] += gain * off
            width = p[corner + c + 1] - p[corner + c]
            left = m[variance + c] * (1.0 - gain * s[passed + c])
            m[variance + c] = max(left, m[at.STEP_NOISE] / (MEMORY * width * width), _LEAST)


@compiled
def begin(p: Floats, s: Floats, m: Floats, force: float) -> None:
    """Begin a way here, at `force` (N): what has been passed until now says nothing."""
    passed = at.AMOUNTS + int(p[at.CELLS])
    for c in range(int(s[at.FIRST]), int(s[at.LAST]) + 1):
        s[passed + c] = 0.0
    s[at.FIRST], s[at.LAST], s[at.PATH], s[at.BEGUN] = p[at.CELLS], -1.0, 0.0, 0.0
    m[at.BASE] = force


@compiled
def slopes(p: Floats, s: Floats, m: Floats, force: float) -> None:
    """Take the slope of the branch from the way just made, where it is long enough, into the cells passed.

    Where `force` (N), or that of the sample before, is not a number, nothing is known of the way between.
    """
    cells = int(p[at.CELLS])
    passed, variance = at.AMOUNTS + cells, at.ARRAYS + cells
    corner = at.EDGES + int(p[at.COUNT]) + 1
    if not (abs(force) < np.inf and abs(m[at.FORCE]) < np.inf):
        begin(p, s, m, force)
        return
    if s[at.BEGUN] > 0.0:
        s[at.BEGUN] = 0.0
        m[at.BASE] = m[at.FORCE]
    first, last = int(s[at.FIRST]), int(s[at.LAST])
    if last >= first:
        m[at.DEEPEST] = max(m[at.DEEPEST], last + 1.0)
    front = min(int(s[at.FRONT]), cells - 1)
    if s[at.PATH] < max(m[at.GATE], 2.0 * (p[corner + front + 1] - p[corner + front])):
        return
    way, new_way, off = 0.0, 0.0, s[at.DIRECTION] * (force - m[at.BASE])
    for c in range(first, last + 1):
        way += s[passed + c]
        off -= s[passed + c] * m[at.ARRAYS + c]
        new_way += s[passed + c] if m[variance + c] == 0.0 else 0.0
    if way > FRACTION * s[at.PATH]:
        if new_way > 0.0:
            guess, typical = off / new_way, m[at.PEAK] / p[corner + int(m[at.DEEPEST])]
            for c in range(first, last + 1):
                if s[passed + c] > 0.0 and m[variance + c] == 0.0:
                    m[at.ARRAYS + c], m[variance + c] = guess, guess * guess + typical * typical
        else:
            m[at.STEPS] = min(m[at.STEPS] + 1.0, NOISE_MEMORY)
            m[at.STEP_NOISE] += (off * off - m[at.STEP_NOISE]) / m[at.STEPS]
            filter_slopes(p, s, m, first, last, off)
    begin(p, s, m, force)
