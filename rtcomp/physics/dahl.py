"""Dahl friction: the stress-strain curve of a solid, taken to sliding."""

from __future__ import annotations

import math

from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.softening import softened
from rtcomp.physics.wires import (
    FRICTION,
    GRAIN,
    GRIP,
    GRIP_LEVEL,
    GRIP_STIFFNESS,
    MOVED,
    REACH,
    SCALE,
    SOFTENS,
)
from rtcomp.physics.yielding import neared, without_noise


@effect_kernel
def dahl(p: Floats, s: Floats, w: Floats) -> None:
    """p: stiffness, coulomb, exponent i; s: force (N), place within the grain and direction."""
    moved = without_noise(s, 1, w[MOVED], w[GRAIN])
    if moved != 0.0:
        level = p[1] * w[REACH]
        direction = math.copysign(1.0, moved)
        gap, travel = 1.0 - s[0] * direction / level, p[0] / level * abs(moved)
        s[0] = direction * level * (1.0 - neared(gap, travel, p[2]))
    w[GRIP] = softened(s[0], p[1] * w[REACH], w[SOFTENS]) * w[SCALE]
    w[GRIP_LEVEL] = p[1]
    w[GRIP_STIFFNESS] = p[0]
    w[FRICTION] += w[GRIP]


@register
class Dahl(Effect):
    """Rate-independent friction with one state and one level."""

    name = "dahl"
    place = Place.FRICTION
    parameters = (
        Parameter("stiffness", "N/m", 0.0, 1e12, "slope of the force at zero force", open_low=True),
        Parameter("coulomb", "N", 0.0, 1e6, "level of sliding", open_low=True),
        Parameter("exponent", "1", 0.0, 10.0, "shape: 0 brittle, 1 exponential, more is ductile", 1.0),
    )
    kernel = dahl
    states = 3
    says = "friction whose slope against displacement falls as it nears its level; the same at every speed"
    equation = "dF/dx = k |1 - F/Fc sgn(v)|^i sgn(1 - F/Fc sgn(v))"
    source = "Dahl (1968), A solid friction model, Aerospace Corporation TOR-0158(3107-18)-1"
    signature = "one curved branch after every reversal, the same at every speed, with no rise before sliding"
    experiment = "reversals inside and beyond presliding at two very different speeds"
    example = {"stiffness": 1e6, "coulomb": 3.0, "exponent": 1.5}
    searchable = False

    def stiffness(self) -> float:
        """Return the slope just after a reversal out of sliding, 2^i k (N/m)."""
        return float(2.0 ** self.values["exponent"] * self.values["stiffness"])
