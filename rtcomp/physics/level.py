"""The level at which sliding friction settles, against speed: Coulomb, static and the fall between them."""

from __future__ import annotations

import math

from rtcomp.kernels import Floats, compiled
from rtcomp.physics.effect import Parameter
from rtcomp.physics.wires import ACCELERATION, LATE, LATE_MIDWAY, SKEW, STEP, VELOCITY

COULOMB = Parameter("coulomb", "N", 0.0, 1e6, "friction of fast sliding, without viscous part", open_low=True)
STATIC = Parameter("static", "N", 0.0, 1e6, "friction at the limit of low speed", open_low=True)
STRIBECK_VELOCITY = Parameter(
    "stribeck_velocity", "m/s", 0.0, 1e3, "speed at which the rise to static has fallen to 1/e", 1e-3, True
)
EXPONENT = Parameter(
    "exponent", "1", 0.0, 10.0, "how sharply the level falls around the Stribeck velocity", 2.0, True
)
VISCOUS = Parameter("viscous", "N s/m", 0.0, 1e6, "friction in proportion to speed", 0.0)

LEVEL = (COULOMB, STATIC, STRIBECK_VELOCITY, EXPONENT)


@compiled
def stribeck_level(coulomb: float, static: float, velocity: float, exponent: float, v: float) -> float:
    """Return s(v) = coulomb + (static - coulomb) exp(-|v / velocity|^exponent), always positive."""
    ratio = abs(v) / velocity
    power = ratio * ratio if exponent == 2.0 else ratio**exponent
    return coulomb + (static - coulomb) * math.exp(-power)


@compiled
def speed_midway(w: Floats) -> float:
    """Return the speed (m/s) that levels follow in the middle of the step that the wires are at the end of.

    For models that integrate a state over the step. Its displacement is made under the level of its middle:
    with that of its end, friction would run ahead of the motion by half a step, first-order in it, and
    stick-slip lives on the difference.
    """
    return float(w[VELOCITY] - 0.5 * w[STEP] * w[ACCELERATION] - w[LATE_MIDWAY])


@compiled
def speed_now(w: Floats) -> float:
    """Return the speed (m/s) that levels follow at the end of the step.

    For what limits or multiplies a force, which is that of the end: with the middle's, friction along a
    recording would come half a row late.
    """
    return float(w[VELOCITY] - w[LATE])


@compiled
def viscous_speed(w: Floats) -> float:
    """Return the velocity (m/s) as viscous friction takes it: late, and weighted by direction."""
    v = w[VELOCITY] - w[LATE]
    return float(v + w[SKEW] * abs(v))
