"""Quadratic minimum within bounds."""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats, compiled


@compiled
def _free(gram: Floats, cross: Floats, state: np.ndarray, c: Floats) -> None:
    """Put the free members of `c` to where the slope is nothing, the others held."""
    free = np.flatnonzero(state == 0)
    if free.size == 0:
        return
    part = np.empty((free.size, free.size))
    right = np.empty(free.size)
    for a in range(free.size):
        i = free[a]
        right[a] = cross[i]
        for j in range(c.size):
            if state[j] != 0:
                right[a] -= gram[i, j] * c[j]
        for b in range(free.size):
            part[a, b] = gram[i, free[b]]
    c[free] = np.linalg.solve(part, right)


@compiled
def _wrong(state: int, c: float, slope: float, low: float, high: float, tolerance: float) -> int:
    """Return -1 or 1 for a free member beyond a bound, 2 for a held one that wants to leave it, else 0."""
    if state == 0:
        return -1 if c < low else (1 if c > high else 0)
    return 2 if state * slope > tolerance else 0


@compiled
def _stepwise(gram: Floats, cross: Floats, low: Floats, high: Floats, tolerance: float) -> Floats:
    """Minimise as `bounded_minimum`, within the bounds all the way, never up (Lawson, Hanson 1974, ch. 23).

    The free members go towards their minimum up to the first bound, which holds the member that meets it; of
    those held the one that gains most is let free.
    """
    size = cross.size
    c = np.minimum(np.maximum(np.zeros(size), low), high)
    state = np.zeros(size, dtype=np.int8)
    for i in range(size):
        state[i] = -1 if c[i] <= low[i] else (1 if c[i] >= high[i] else 0)
    for _ in range(20 * size):
        met = 0
        while met >= 0:
            aim = c.copy()
            _free(gram, cross, state, aim)
            met, part = -1, 1.0
            for i in range(size):
                if state[i] == 0 and (aim[i] < low[i] or aim[i] > high[i]):
                    way = ((low[i] if aim[i] < low[i] else high[i]) - c[i]) / (aim[i] - c[i])
                    if way < part:
                        met, part = i, way
            c += part * (aim - c)
            if met >= 0:
                state[met] = -1 if aim[met] < low[met] else 1
                c[met] = low[met] if state[met] < 0 else high[met]
        slope = gram @ c - cross
        gains = np.where(state != 0, state * slope, 0.0)
        best = int(np.argmax(gains))
        if gains[best] <= tolerance:
            break
        state[best] = 0
    return c


@compiled
def bounded_minimum(gram: Floats, cross: Floats, low: Floats, high: Floats) -> Floats:
    """Minimise c' G c / 2 - h' c within bounds by an active set (Portugal, Judice, Vicente 1994).

    The set changes as a whole at first and by single members when that would cycle. Where columns are so
    alike that this does not end, it goes down step by step.
    """
    size = cross.size
    state = np.zeros(size, dtype=np.int8)  # 0 free, -1 at low, 1 at high
    wrong = np.zeros(size, dtype=np.int8)
    best, rounds = size + 1, 5
    tolerance = 1e-10 * (np.abs(cross).max() + 1.0)
    c = np.zeros(size)
    for _ in range(20 * size):
        for i in range(size):
            if state[i] != 0:
                c[i] = low[i] if state[i] < 0 else high[i]
        _free(gram, cross, state, c)
        slope = gram @ c - cross
        count = last = 0
        for i in range(size):
            wrong[i] = _wrong(state[i], c[i], slope[i], low[i], high[i], tolerance)
            if wrong[i] != 0:
                count, last = count + 1, i
        if count == 0:
            return c
        single = False
        if count < best:
            best, rounds = count, 5
        elif rounds > 0:
            rounds -= 1
        else:
            single = True
        for i in range(size):
            if wrong[i] != 0 and (i == last or not single):
                state[i] = 0 if wrong[i] == 2 else wrong[i]
    return _stepwise(gram, cross, low, high, tolerance)
