"""Maxwell-slip friction: a bank of elements in parallel. Rate-independent, with non-local memory."""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats, effect_kernel, summing
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Parameter, Place
from rtcomp.physics.lists import ListEffect
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
from rtcomp.physics.yielding import stretched, without_noise, yielded

STIFFNESS = Parameter("stiffness", "N/m", -1e12, 1e12, "spring of the element", physical_low=0.0)
EXPONENT = Parameter("exponent", "1", 0.0, 10.0, "of Dahl's law by which elements yield; 0 is a stop", 0.0)
REACH_M = Parameter("reach", "m", 0.0, 1e3, "travel at which the element yields", open_low=True)


@summing
def _held(p: Floats, s: Floats, count: int, moved: float, longer: float) -> float:
    """Move `count` elements on, and return the force of their sum (N)."""
    force = 0.0
    for i in range(count):
        s[i] = stretched(s[i], moved, p[1 + count + i] * longer)
        force += p[1 + i] * s[i]
    return force


@effect_kernel
def maxwell_slip(p: Floats, s: Floats, w: Floats) -> None:
    """p: count, stiffnesses, reaches, level, whole stiffness, exponent.

    s: deflection (m) of each element, place within the grain and direction (`without_noise`).
    """
    count, longer, softening = int(p[0]), w[REACH], w[SOFTENS]
    exponent = p[3 + 2 * count]
    if exponent == 0.0:
        force = _held(p, s, count, w[MOVED], longer)
    else:
        force, moved = 0.0, without_noise(s, count, w[MOVED], w[GRAIN])
        for i in range(count):
            s[i] = yielded(s[i], moved, p[1 + count + i] * longer, exponent)
            force += p[1 + i] * s[i]
    if softening != 0.0:
        force = 0.0
        for i in range(count):
            force += p[1 + i] * softened(s[i], p[1 + count + i] * longer, softening)
    w[GRIP] = force * w[SCALE]
    w[GRIP_LEVEL] = p[1 + 2 * count]
    w[GRIP_STIFFNESS] = p[2 + 2 * count]
    w[FRICTION] += w[GRIP]


@register
class MaxwellSlip(ListEffect):
    """Elements in parallel; `elements` is a list of (stiffness N/m, reach m), `exponent` how they yield."""

    name = "maxwell-slip"
    place = Place.FRICTION
    parameters = (EXPONENT,)
    element = (STIFFNESS, REACH_M)
    kernel = maxwell_slip
    says = "presliding hysteresis of springs and sliders in parallel; yielded, one pushes stiffness * reach"
    equation = "F = sum k_i z_i,  dz_i/dx = |1 - z_i/r_i sgn(v)|^n sgn(1 - z_i/r_i sgn(v)); of n = 0 a stop"
    source = "Iwan (1966), J. Applied Mechanics 33(4); Lampaert, Swevers, Al-Bender (2002), IEEE TAC 47(4)"
    signature = (
        "closed hysteresis loops of force against position whose branches are the virgin curve doubled"
    )
    experiment = "nested reversals of decreasing size inside the presliding range"
    example = {"elements": [{"stiffness": 8e5, "reach": 2e-6}, {"stiffness": 4e5, "reach": 7e-6}]}
    searchable = False

    def vector(self) -> Floats:
        """Return count, stiffnesses, reaches, level (N), the stiffness of all elements (N/m), exponent."""
        stiffness, reach = zip(*self.elements, strict=True)
        return np.array([len(self.elements), *stiffness, *reach, self.level, sum(stiffness), self.exponent])

    def initial_state(self) -> Floats:
        """Return the elements' deflections, all relaxed, and no motion within the grain."""
        return np.zeros(len(self.elements) + 2)

    def stiffness(self) -> float:
        """Return the stiffness just after a reversal out of sliding (N/m)."""
        return float(2.0**self.exponent * sum(abs(k) for k, _ in self.elements))

    @property
    def exponent(self) -> float:
        """Exponent of the law by which elements yield."""
        return float(self.values["exponent"])

    @property
    def level(self) -> float:
        """Force with every element yielded (N)."""
        return float(sum(k * r for k, r in self.elements))
