"""Quadratic minimum within bounds."""

from __future__ import annotations

import math

import numpy as np

from rtcomp.kernels import Floats, compiled, summing

ROUNDS = 5
"""Changes of the active set that may leave no fewer members wrong than before."""


@summing
def _product(one: Floats, other: Floats, count: int) -> float:
    """Return the product of the first members of two rows."""
    total = 0.0
    for k in range(count):
        total += one[k] * other[k]
    return total


@compiled
def _free(gram: Floats, cross: Floats, state: np.ndarray, c: Floats) -> None:
    """Put the free members of `c` to where the slope is nothing, the others held, by Cholesky's factor.

    Written out: numba's own solver alone takes as long to compile as the rest of a diagnosis. Raises
    LinAlgError where the free part of `gram` is not positive definite.
    """
    factor, aim = np.empty((c.size, c.size)), np.empty(c.size)
    free = np.empty(c.size, dtype=np.int64)
    count = 0
    for i in range(c.size):
        if state[i] != 0:
            continue
        right = cross[i]
        for j in range(c.size):
            if state[j] != 0:
                right -= gram[i, j] * c[j]
        row = factor[count]
        for b in range(count):
            row[b] = (gram[i, free[b]] - _product(row, factor[b], b)) / factor[b, b]
        pivot = gram[i, i] - _product(row, row, count)
        if not 0.0 < pivot < np.inf:
            raise np.linalg.LinAlgError("columns are alike, or hold no numbers")
        row[count] = math.sqrt(pivot)
        aim[count] = (right - _product(row, aim, count)) / row[count]
        free[count] = i
        count += 1
    for a in range(count - 1, -1, -1):
        for b in range(a + 1, count):
            aim[a] -= factor[b, a] * aim[b]
        aim[a] /= factor[a, a]
        c[free[a]] = aim[a]


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
    c, aim = np.empty(size), np.empty(size)
    state = np.zeros(size, dtype=np.int8)
    for i in range(size):
        c[i] = min(max(0.0, low[i]), high[i])
        state[i] = -1 if c[i] <= low[i] else (1 if c[i] >= high[i] else 0)
    for _ in range(20 * size):
        met = 0
        while met >= 0:
            for i in range(size):
                aim[i] = c[i]
            _free(gram, cross, state, aim)
            met, part = -1, 1.0
            for i in range(size):
                if state[i] == 0 and (aim[i] < low[i] or aim[i] > high[i]):
                    way = ((low[i] if aim[i] < low[i] else high[i]) - c[i]) / (aim[i] - c[i])
                    if way < part:
                        met, part = i, way
            for i in range(size):
                c[i] += part * (aim[i] - c[i])
            if met >= 0:
                state[met] = -1 if aim[met] < low[met] else 1
                c[met] = low[met] if state[met] < 0 else high[met]
        best, most = -1, tolerance
        for i in range(size):
            gain = state[i] * (_product(gram[i], c, size) - cross[i])
            if gain > most:
                best, most = i, gain
        if best < 0:
            break
        state[best] = 0
    return c


@compiled
def bounded_minimum(gram: Floats, cross: Floats, low: Floats, high: Floats) -> Floats:
    """Minimise c' G c / 2 - h' c within bounds by an active set (Portugal, Judice, Vicente 1994).

    The set changes as a whole. Where columns are so alike that fewer and fewer members being wrong is not
    what comes of it, it goes down step by step.
    """
    size = cross.size
    state = np.zeros(size, dtype=np.int8)  # 0 free, -1 at low, 1 at high
    wrong = np.zeros(size, dtype=np.int8)
    best, rounds = size + 1, ROUNDS
    most = 0.0
    for i in range(size):
        most = max(most, abs(cross[i]))
    tolerance = 1e-10 * (most + 1.0)
    c = np.zeros(size)
    while rounds > 0:
        for i in range(size):
            if state[i] != 0:
                c[i] = low[i] if state[i] < 0 else high[i]
        _free(gram, cross, state, c)
        count = 0
        for i in range(size):
            slope = _product(gram[i], c, size) - cross[i]
            wrong[i] = _wrong(state[i], c[i], slope, low[i], high[i], tolerance)
            if wrong[i] != 0:
                count += 1
        if count == 0:
            return c
        if count < best:
            best, rounds = count, ROUNDS
        else:
            rounds -= 1
        for i in range(size):
            if wrong[i] != 0:
                state[i] = 0 if wrong[i] == 2 else wrong[i]
    return _stepwise(gram, cross, low, high, tolerance)
