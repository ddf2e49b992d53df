"""Bouc-Wen hysteresis: a restoring force with memory, in parallel to everything else that acts on the mass.

At equal direction the equation is one of displacement only, so it is the same at every speed. With u the
force z along the motion and r the travel::

    du/dr = alpha - c |u|^n,  c = beta (gamma + delta) where u >= 0, beta (delta - gamma) where u < 0

For n = 1 it is linear on either side of zero, and a displacement of any size is exact. For other n the travel
is cut into steps, in each of which the equation is linearised where it stands (exponential Rosenbrock-Euler,
as in `approach`): within 1e-3 of the force.
"""

from __future__ import annotations

import math
from typing import Final

from rtcomp.kernels import Floats, compiled, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.wires import FRICTION, MOVED, STEP, VELOCITY

FINE: Final = 0.05
"""Longest step (1) of the linearised equation, in units of its travel."""
STEPS: Final = 256
"""Most such steps in one call; the last takes what is left."""
LARGEST: Final = 1e9
"""Largest force (N): where the force grows with itself, it would leave the range of floats."""
STROKE: Final = 1e-2
"""Travel without a reversal (m, rad) up to which `stiffness` holds where the force has no level."""
GROWN: Final = 20.0
"""Force over alpha times that travel, up to which it holds."""


@compiled
def grown(slope: float, curvature: float, travel: float) -> float:
    """Return the change of u over `travel` where u' is `slope`, and `curvature` its derivative by u."""
    x = min(curvature * travel, 600.0)
    return slope * (travel * (1.0 + 0.5 * x) if abs(x) < 1e-8 else math.expm1(x) / curvature)


@compiled
def pulled(z: float, moved: float, alpha: float, beta: float, gamma: float, delta: float, n: float) -> float:
    """Return the force z (N) after it was `moved` (m) in one direction."""
    way = 1.0 if moved > 0.0 else -1.0
    u, left = way * z, abs(moved)
    for step in range(STEPS):
        if left <= 0.0:
            break
        side = 1.0 if u >= 0.0 else -1.0
        c = beta * (delta + side * gamma)
        size = abs(u)
        power = 1.0 if n == 1.0 else size ** (n - 1.0)
        slope = alpha - c * power * size
        curvature = -side * n * c * power
        travel = left
        if n != 1.0 and c != 0.0 and step < STEPS - 1:
            level = (alpha / abs(c)) ** (1.0 / n)
            travel = min(travel, FINE * level / alpha, FINE / max(abs(curvature), 1e-300))
        change = grown(slope, curvature, travel)
        if u < 0.0 < u + change:  # from zero on, another equation holds
            x = -u * curvature / slope
            travel = math.log1p(x) / curvature if abs(x) > 1e-8 else -u / slope * (1.0 - 0.5 * x)
            u = 0.0
        else:
            u = min(max(u + change, -LARGEST), LARGEST)
        left -= travel
    return way * u


@effect_kernel
def bouc_wen(p: Floats, s: Floats, w: Floats) -> None:
    """p: alpha, beta, gamma, delta, exponent; s: force z (N), velocity at the last call (m/s).

    Within the step the motion is the cubic through its ends with the velocities there, of which only the
    places of its reversals matter.
    """
    if p[0] == 0.0:
        s[0] = 0.0
        return
    m, a, b = w[MOVED], s[1] * w[STEP], w[VELOCITY] * w[STEP]
    s[1] = w[VELOCITY]
    at = 0.0
    if a * m <= 0.0 or b * m <= 0.0:  # it may turn within the step, where a + 2 q t + k t^2 = 0
        q, k = 3.0 * m - 2.0 * a - b, 3.0 * (a + b - 2.0 * m)
        root = q * q - k * a
        if root > 0.0:
            far = -(q + math.copysign(math.sqrt(root), q))
            one = a / far if far != 0.0 else -1.0
            two = far / k if abs(k) > 1e-12 * abs(far) else -1.0
            for t in (min(one, two), max(one, two)):
                if 0.0 < t < 1.0:
                    place = t * (a + t * (q + t * k / 3.0))
                    s[0] = pulled(s[0], place - at, p[0], p[1], p[2], p[3], p[4])
                    at = place
    s[0] = pulled(s[0], m - at, p[0], p[1], p[2], p[3], p[4])
    w[FRICTION] += s[0]


@register
class BoucWen(Effect):
    """A hysteretic force of the Bouc-Wen equation, beside the stage's friction model.

    It is linear in `alpha` where the exponent is 1. `beta`, `gamma` and `delta` act by their products only,
    so a fit holds `gamma`. With gamma + delta > 0 the force has the level (alpha / (beta (gamma +
    delta)))^(1 / exponent); with less it stiffens along each stroke without end. Where the exponent is not
    1, |z| counts in N and the unit of `beta` is 1/m over N^(exponent - 1). What modifies the level or size
    of a friction model leaves this force as it is.

    Between rows the motion is a cubic with the velocities at the rows. On the Bouc-Wen benchmark (5 to 150 Hz
    at rows of 750 Hz) the force at the rows errs by 0.01 % of its rms with velocities from the spectrum of
    position, by 0.1 % with those of central differences. Straight lines between rows, which miss where the
    motion turns, would make that 1 %.
    """

    name = "bouc-wen"
    place = Place.FRICTION
    parameters = (
        Parameter("alpha", "N/m", 0.0, 1e12, "stiffness at zero hysteretic force"),
        Parameter("beta", "1/m", 0.0, 1e12, "how soon the force bends", open_low=True),
        Parameter(
            "gamma", "1", 0.0, 1e3, "part of the bend with the sign of the force: dissipates", held=True
        ),
        Parameter("delta", "1", -1e3, 1e3, "part of the bend with the sign of motion: softens or stiffens"),
        Parameter("exponent", "1", 1.0, 20.0, "how sharp the bend is", 1.0),
    )
    kernel = bouc_wen
    says = "a hysteretic restoring force: joints, dampers, wire ropes"
    equation = "z' = alpha v - beta (gamma |v| |z|^(n-1) z + delta v |z|^n),  F = z"
    source = "Bouc (1967); Wen (1976), J. Engineering Mechanics 102(2); Noel, Schoukens (2016), benchmark"
    signature = (
        "residual force with memory of the last reversals, alike at all speeds, beside a linear spring"
    )
    experiment = "a multisine or strokes of several sizes, slowly and fast"
    example = {"alpha": 5e4, "beta": 1e4, "gamma": 0.8, "delta": -0.3}
    neutral = {"alpha": 0.0}
    linear = ("alpha",)
    search_grid = {"gamma": (0.5,), "delta": (-0.5, 0.0, 0.5)}
    states = 2

    def stiffness(self) -> float:
        """Return the slope at a reversal from the level, or from 10 mm (10 mrad) of stiffening (N/m)."""
        alpha, beta, gamma, delta, n = self.vector()
        bend = beta * abs(gamma + delta)
        highest = GROWN * alpha * STROKE
        level = (alpha / bend) ** (1.0 / n) if bend > 0.0 else math.inf
        highest = min(highest, level if gamma + delta > 0.0 else GROWN * level)
        return float(alpha + max(beta * (gamma - delta), 0.0) * highest**n)
