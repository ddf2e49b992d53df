"""LuGre friction: bristles with one state, a level that falls with speed, and frictional lag."""

from __future__ import annotations

import math

from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.level import LEVEL, VISCOUS, speed_midway, stribeck_level, viscous_speed
from rtcomp.physics.softening import softened
from rtcomp.physics.wires import (
    FRICTION,
    GRAIN,
    GRIP,
    GRIP_LEVEL,
    GRIP_STIFFNESS,
    LATE,
    MOVED,
    REACH,
    SCALE,
    SOFTENS,
    VELOCITY,
)  # fmt: skip
from rtcomp.physics.yielding import without_noise


@effect_kernel
def lugre(p: Floats, s: Floats, w: Floats) -> None:
    """p: stiffness, damping, coulomb, static, Stribeck velocity, exponent, viscous.

    s: deflection z (m), place within the grain and direction.
    """
    v = w[VELOCITY]
    moved = without_noise(s, 1, w[MOVED], w[GRAIN])
    level = stribeck_level(p[2], p[3], p[4], p[5], speed_midway(w))
    settled = level * w[REACH] / p[0]
    # The solution at constant speed depends on the displacement only: exact for a step of any size.
    s[0] += (math.copysign(settled, moved) - s[0]) * -math.expm1(-abs(moved) / settled)
    rate = v - abs(v) * s[0] * p[0] / (stribeck_level(p[2], p[3], p[4], p[5], v - w[LATE]) * w[REACH])
    w[GRIP] = softened(p[0] * s[0], level * w[REACH], w[SOFTENS]) * w[SCALE]
    w[GRIP_LEVEL] = level
    w[GRIP_STIFFNESS] = p[0]
    w[FRICTION] += w[GRIP] + p[1] * rate * w[SCALE] + p[6] * viscous_speed(w)


@register
class LuGre(Effect):
    """Bristle friction with one state."""

    name = "lugre"
    place = Place.FRICTION
    parameters = (
        Parameter("stiffness", "N/m", 0.0, 1e12, "bristle stiffness sigma_0", open_low=True),
        Parameter("damping", "N s/m", 0.0, 1e8, "bristle damping sigma_1", 0.0),
        *LEVEL,
        VISCOUS,
    )
    kernel = lugre
    states = 3
    says = (
        "bristles that bend and give way: presliding, Stribeck curve and frictional lag from a single state"
    )
    equation = "dz/dt = v - sigma_0 |v| z / s(v),  F = sigma_0 z + sigma_1 dz/dt + sigma_2 v"
    source = "Canudas de Wit, Olsson, Astrom, Lischinsky (1995), IEEE TAC 40(3)"
    signature = "one curved branch after every reversal, whatever came before: minor loops drift"
    experiment = "presliding loops for the stiffness, then constant speeds around the Stribeck velocity"
    example = {
        "stiffness": 1e6, "damping": 300.0, "coulomb": 3.0, "static": 4.0,
        "stribeck_velocity": 2e-3, "exponent": 2.0, "viscous": 5.0,
    }  # fmt: skip
    linear = ("damping", "viscous")
    searchable = False

    def stiffness(self) -> float:
        """Return twice sigma_0, reached just after a reversal out of sliding (N/m)."""
        return 2.0 * self.values["stiffness"]

    def damping(self) -> float:
        """Return twice sigma_1, reached like the stiffness, and sigma_2 (N s/m)."""
        return 2.0 * self.values["damping"] + self.values["viscous"]
