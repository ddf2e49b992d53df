"""Friction whose level depends on position."""

from __future__ import annotations

import math

from rtcomp.kernels import Floats, compiled, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.growing import GROWTH, LEAST, grow
from rtcomp.physics.waves import PERIOD, PHASE, SINE, TRIANGLE, triangle
from rtcomp.physics.wires import POSITION


@compiled
def _vary(p: Floats, w: Floats, factor: float) -> None:
    """Multiply the level of friction by `factor`; friction never drives."""
    factor = max(factor, LEAST)
    grow(w, factor, factor, p[4], p[5])


@effect_kernel
def position_dependent_friction(p: Floats, s: Floats, w: Floats) -> None:
    """p: amplitude (1), period (m), phase (rad), slope (1/m), stiffening (1), following (1)."""
    x = w[POSITION]
    _vary(p, w, 1.0 + p[0] * math.sin(2.0 * math.pi * x / p[1] + p[2]) + p[3] * x)


@effect_kernel
def position_dependent_triangle(p: Floats, s: Floats, w: Floats) -> None:
    """p: as `position_dependent_friction`."""
    x = w[POSITION]
    _vary(p, w, 1.0 + p[0] * triangle(2.0 * math.pi * x / p[1] + p[2]) + p[3] * x)


@register
class PositionDependentFriction(Effect):
    """Friction level varies along the stroke.

    With `stiffening` 0 contacts yield later at equal stiffness; with 1 the whole force varies, as where the
    number of contacts does. The periodic part is a sine or, in the form `triangle`, a triangle.
    """

    name = "position-dependent-friction"
    place = Place.FRICTION
    parameters = (
        Parameter("amplitude", "1", -1.0, 1.0, "relative size of the periodic part"),
        PERIOD,
        PHASE,
        Parameter("slope", "1/m", -1e6, 1e6, "relative growth along the stroke", 0.0),
        *GROWTH,
    )
    kernel = position_dependent_friction
    forms = {SINE: position_dependent_friction, TRIANGLE: position_dependent_triangle}
    says = "contacts yield later in some places than in others: preload, wear, dirt"
    equation = "yield <- yield (1 + a sin(2 pi x / period + phase) + slope x), at equal stiffness or reach"
    source = (
        "Popovic, Goldenberg (1998), IEEE Trans. Robotics and Automation 14(1), spectral friction in position"
    )
    signature = "residual force that depends on position and changes its sign with the direction of motion"
    experiment = "slow strokes over the whole travel in both directions"
    example = {"amplitude": 0.3, "period": 7e-4, "phase": 0.5, "slope": 150.0}
    neutral = {"amplitude": 0.0, "slope": 0.0}
    linear = ("amplitude", "slope")
    search_grid = {"stiffening": (0.0, 1.0)}
    order = 20
