"""The mechanics: mass, spring, weight, contact."""

from __future__ import annotations

import math
from typing import Any

from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.wires import MASS, POSITION, PUSH

STROKE = 1e-2
"""Deflection (m, rad) for which `parallel-spring` tells the stiffness of its cubic part. Steps have a
wide margin (omega h <= 0.05), so deflections a few tens of times larger are still stable."""


@effect_kernel
def inertia(p: Floats, s: Floats, w: Floats) -> None:
    """p: mass (kg)."""
    w[MASS] = p[0]


@effect_kernel
def parallel_spring(p: Floats, s: Floats, w: Floats) -> None:
    """p: stiffness (N/m), cubic (N/m^3)."""
    x = w[POSITION]
    w[PUSH] -= (p[0] + p[1] * x * x) * x


@effect_kernel
def gravity(p: Floats, s: Floats, w: Floats) -> None:
    """p: force (N), amplitude (N m), phase (rad)."""
    w[PUSH] += p[0] + p[1] * math.sin(w[POSITION] + p[2])


@effect_kernel
def end_stop(p: Floats, s: Floats, w: Floats) -> None:
    """p: position (m), stiffness (N/m)."""
    depth = w[POSITION] - p[0]
    if (depth > 0.0) if p[0] >= 0.0 else (depth < 0.0):
        w[PUSH] -= p[1] * depth


@register
class Inertia(Effect):
    """Moving mass is not what was believed."""

    name = "inertia"
    place = Place.MECHANICS
    parameters = (
        Parameter("mass", "kg", 0.0, 1e6, "true moving mass, in place of the believed", open_low=True),
    )
    kernel = inertia
    says = "the moving mass is not what was believed"
    equation = "m <- mass"
    source = "Newton's second law"
    signature = "residual force in proportion to acceleration"
    experiment = "fast reversals beside slow strokes over the same stretch"
    example = {"mass": 2.4}
    linear = ("mass",)
    moving_mass = True
    stands_for = "mass"
    order = 10


@register
class ParallelSpring(Effect):
    """Flexure, cable or hose between mass and ground."""

    name = "parallel-spring"
    place = Place.MECHANICS
    parameters = (
        Parameter("stiffness", "N/m", -1e9, 1e9, "spring constant at position zero"),
        Parameter("cubic", "N/m^3", -1e18, 1e18, "stiffening with the cube of position", 0.0),
    )
    kernel = parallel_spring
    says = "a spring between mass and ground: flexure, cable, hose"
    equation = "F = -(k x + c x^3)"
    source = "Hooke's law; Duffing (1918) for the cubic part"
    signature = "residual force that falls with position, alike in both directions and at all speeds"
    experiment = "slow strokes over the whole travel, coming back to the same places later"
    example = {"stiffness": 1500.0, "cubic": 1e9}
    neutral = {"stiffness": 0.0, "cubic": 0.0}
    linear = ("stiffness", "cubic")

    def stiffness(self) -> float:
        """Return the slope at 10 mm (10 mrad) from zero (N/m)."""
        return self.stiffness_within(STROKE)

    def stiffness_within(self, stroke: float) -> float:
        """Return the slope at `stroke` (m) from zero (N/m)."""
        return abs(self.values["stiffness"]) + 3.0 * abs(self.values["cubic"]) * stroke**2


@register
class Gravity(Effect):
    """Weight: a constant force on a linear axis, a sine of the angle on a rotary one."""

    name = "gravity"
    place = Place.MECHANICS
    parameters = (
        Parameter("force", "N", -1e6, 1e6, "weight along a linear axis", 0.0),
        Parameter("amplitude", "N m", -1e6, 1e6, "largest moment about a rotary axis", 0.0, physical_low=0.0),
        Parameter("phase", "rad", -100.0, 100.0, "angle from the horizontal at position zero", 0.0),
    )
    kernel = gravity
    says = "weight along the axis, or the moment of an unbalanced mass about it"
    equation = "F = force + amplitude sin(x + phase)"
    source = "Newton's law of gravitation"
    signature = "residual force constant on a linear axis, with a period of one turn on a rotary one"
    experiment = "slow strokes in both directions; on a rotary axis over a whole turn"
    example = {"force": 2.0}
    neutral = {"force": 0.0, "amplitude": 0.0}
    linear = ("force", "amplitude")
    bias = True
    known_law = True

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        if "force" not in values and "amplitude" not in values:
            raise ConfigError(
                "gravity: give its force (N), or on a rotary axis its amplitude (N m) and phase (rad)"
            )

    def stiffness(self) -> float:
        """Return the steepest slope of moment against angle (N m/rad)."""
        return abs(self.values["amplitude"])


@register
class EndStop(Effect):
    """Contact inside the stroke."""

    name = "end-stop"
    place = Place.MECHANICS
    parameters = (
        Parameter(
            "position", "m", -1e6, 1e6, "where contact begins: above it if positive or zero, else below it"
        ),
        Parameter("stiffness", "N/m", 0.0, 1e12, "spring constant of the contact"),
    )
    kernel = end_stop
    says = "the mass meets an elastic stop inside the stroke"
    equation = "F = -k (x - x_s) where x is beyond x_s (further from zero), else 0"
    source = "Hooke's law, one-sided"
    signature = "residual force that grows from one position onwards and is zero before it"
    experiment = "a slow approach to both ends of the stroke"
    example = {"position": 6e-4, "stiffness": 2e4}
    neutral = {"stiffness": 0.0}
    linear = ("stiffness",)

    def stiffness(self) -> float:
        """Return the stiffness of the contact (N/m)."""
        return self.values["stiffness"]
