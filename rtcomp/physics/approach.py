"""The approach to sliding that both Leuven models share: q' = 1 - sgn(q) |q|^n, towards q = 1.

q is the force along the motion as a share of the level, ' is against travel in units of level over slope.
There is no closed form for general n, so a step takes the exact solution of the equation linearised where it
stands (exponential Rosenbrock), which is exact for n = 1 and near q = 1, and it never passes q = 1.
"""

from __future__ import annotations

import math

from rtcomp.kernels import compiled
from rtcomp.physics.effect import Parameter

SHARPNESS = Parameter("sharpness", "1", 1.0, 100.0, "exponent n of the transition to sliding", 2.0)

LONGEST = 0.1
"""Longest step (1) that a kernel takes at once; the error of one is below 1e-3 of the level."""
STEPS = 96
"""Most such steps in one call; the last takes what is left, by then close to the level or at it."""


@compiled
def drop(q: float, n: float) -> float:
    """Return sgn(q) |q|^n."""
    if n == 2.0:
        return q * abs(q)
    if n == 1.0:
        return q
    return math.copysign(abs(q) ** n, q)


@compiled
def flow(q: float, n: float) -> float:
    """Return 1 - sgn(q) |q|^n, the rate of the state over the speed, held within -1 and 2.

    Only a level that falls in an instant would lead outside; then the state moves no faster than the mass.
    """
    return 1.0 - min(max(drop(min(max(q, -2.0), 2.0), n), -1.0), 2.0)


@compiled
def advance(q: float, n: float, h: float) -> float:
    """Return q after travel h >= 0 (1)."""
    q = min(max(q, -1e3), 1e3)  # keeps its n-th power a float
    power = drop(q, n)
    slope = -n * abs(power) / abs(q) if q != 0.0 else (-1.0 if n == 1.0 else 0.0)
    change = slope * h
    factor = math.expm1(change) / slope if change < -1e-9 else h
    new = q + (1.0 - power) * factor
    if q <= 1.0:
        return min(new, 1.0)
    return max(new, 1.0)
