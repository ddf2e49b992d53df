"""The approach to sliding that both Leuven models share: q' = 1 - sgn(q) |q|^n, towards q = 1.

q is the force along the motion as a share of the level, ' is against travel in units of level over slope.
There is no closed form for general n, so a step takes the exact solution of the equation linearised where
it stands, which is exact for n = 1 and near q = 1; longer steps are corrected once. (Exponential Rosenbrock
methods of order 2 and 3: Hochbruck, Ostermann, Schweitzer (2009), SIAM J. Numerical Analysis 47(1).)
"""

from __future__ import annotations

import math

from rtcomp.kernels import compiled
from rtcomp.physics.effect import Parameter

SHARPNESS = Parameter("sharpness", "1", 1.0, 100.0, "exponent n of the transition to sliding", 2.0)

LONGEST = 0.1
"""Longest step (1) taken at once; errors stay below 2e-3 of the level for n <= 5, 1e-2 at 20."""
SHORT = 0.005
"""Below this the plain exponential step is as good."""
STEPS = 96
"""Most such steps in one call; the last takes what is left, by then close to the level or at it."""


@compiled
def longest(n: float) -> float:
    """Return the longest step (1) to take at once: shorter where the knee is sharp."""
    return LONGEST * min(max(8.0 / n, 0.3), 1.0)


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
def _from_below(q: float, n: float, h: float) -> float:
    """Advance a q of at most 1."""
    power = drop(q, n)
    slope = -n * abs(power) / abs(q) if q != 0.0 else (-1.0 if n == 1.0 else 0.0)
    change = slope * h
    new = q + (1.0 - power) * (math.expm1(change) / slope if change < -1e-9 else h)
    if h > SHORT:  # one order more: what the linearisation leaves out at the end of the step
        bend = (1.0 - drop(new, n)) - (1.0 - power) - slope * (new - q)
        if change < -0.1:
            third = (math.expm1(change) - change - 0.5 * change * change) / (change * change * change)
        else:
            third = 1.0 / 6.0 + change / 24.0
        new += 2.0 * h * third * bend
    return min(max(new, q), 1.0)


@compiled
def advance(q: float, n: float, h: float) -> float:
    """Return q after travel h >= 0 (1)."""
    if q <= 1.0:
        return _from_below(max(q, -2.0), n, h)
    if n < 1.01:
        return 1.0 + (q - 1.0) * math.exp(-n * h)
    # q^(1 - n) obeys the same law from below, with exponent n / (n - 1) and travel n - 1 times as long.
    turned = math.exp((1.0 - n) * math.log(q))
    turned = _from_below(turned, n / (n - 1.0), (n - 1.0) * h)
    return math.exp(math.log(max(turned, 1e-290)) / (1.0 - n))
