"""Modified Leuven friction: a Maxwell-slip bank driven by a state that stops growing as sliding begins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.approach import SHARPNESS, STEPS, advance, flow, longest
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Parameter, Place
from rtcomp.physics.level import LEVEL, VISCOUS, speed_midway, stribeck_level, viscous_speed
from rtcomp.physics.lists import ListEffect
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

DAMPING = Parameter("damping", "N s/m", 0.0, 1e8, "damping sigma_1 of the presliding state", 0.0)


@effect_kernel
def modified_leuven(p: Floats, s: Floats, w: Floats) -> None:
    """p: coulomb, static, Stribeck velocity, exponent, sharpness, damping, viscous, count, then elements,
    then the whole stiffness.

    Elements are stiffness and reach each; s: deflection (m) of each, place within the grain and direction.
    Within a step the motion is cut where the force would change by more than a tenth of the level, so a long
    step is as right as many short ones.
    """
    v = w[VELOCITY]
    n = p[4]
    count = int(p[7])
    widen = w[REACH]
    nominal = stribeck_level(p[0], p[1], p[2], p[3], speed_midway(w))
    level = nominal * widen
    cut = longest(n)
    moved = without_noise(s, count, w[MOVED], w[GRAIN])
    left, direction = abs(moved), math.copysign(1.0, moved)
    steps = 0
    while left > 0.0:
        along = 0.0
        loaded = (
            0.0  # stiffness that still takes load forward, and backward (when the level has fallen below)
        )
        unloading = 0.0
        for i in range(count):
            deflection = direction * s[i]
            along += p[8 + 2 * i] * deflection
            reach = p[9 + 2 * i] * widen
            if deflection < reach:
                loaded += p[8 + 2 * i]
            if deflection > -reach:
                unloading += p[8 + 2 * i]
        q = along / level
        stiffness = loaded if q < 1.0 else unloading
        if abs(q - 1.0) < 1e-15 or stiffness == 0.0:
            break
        h = left * stiffness / level
        steps += 1
        if h > cut and steps < STEPS:
            h = cut
            left -= h * level / stiffness
        else:
            left = 0.0
        z = direction * (advance(q, n, h) - q) * level / stiffness
        for i in range(count):
            reach = p[9 + 2 * i] * widen
            s[i] = min(max(s[i] + z, -reach), reach)
    force = bent = 0.0
    for i in range(count):
        reach = p[9 + 2 * i] * widen
        s[i] = min(max(s[i], -reach), reach)
        force += p[8 + 2 * i] * s[i]
        bent += p[8 + 2 * i] * softened(s[i], reach, w[SOFTENS])
    level = stribeck_level(p[0], p[1], p[2], p[3], v - w[LATE]) * widen
    rate = v * flow(math.copysign(1.0, v) * force / level, n)
    w[GRIP] = bent * w[SCALE]
    w[GRIP_LEVEL] = nominal
    w[GRIP_STIFFNESS] = p[8 + 2 * count]
    w[FRICTION] += w[GRIP] + p[5] * rate * w[SCALE] + p[6] * viscous_speed(w)


@register
class ModifiedLeuven(ListEffect):
    """The Leuven model without its stack; `elements` is a list of {stiffness, reach}."""

    name = "modified-leuven"
    place = Place.FRICTION
    parameters = (*LEVEL, SHARPNESS, DAMPING, VISCOUS)
    element = (
        Parameter("stiffness", "N/m", 0.0, 1e12, "spring of the element", open_low=True),
        Parameter("reach", "m", 0.0, 1e3, "deflection at which the element yields", open_low=True),
    )
    kernel = modified_leuven
    says = "a Maxwell-slip bank in a state z that follows the motion and comes to rest in sliding"
    equation = (
        "dz/dt = v (1 - sgn(F_h / s) |F_h / s|^n), F_h a Maxwell-slip bank in z, s signed by v; "
        "F = F_h + sigma_1 dz/dt + sigma_2 v"
    )
    source = "Lampaert, Swevers, Al-Bender (2002), IEEE TAC 47(4)"
    signature = "presliding loops with non-local memory that pass smoothly into sliding, falling with speed"
    experiment = "nested presliding reversals, then constant speeds around the Stribeck velocity"
    example = {
        "coulomb": 3.0, "static": 4.0, "stribeck_velocity": 2e-3, "exponent": 2.0, "sharpness": 3.0,
        "damping": 200.0, "viscous": 5.0,
        "elements": [{"stiffness": 8e5, "reach": 2e-6}, {"stiffness": 4e5, "reach": 7e-6}],
    }  # fmt: skip
    linear = ("damping", "viscous")
    searchable = False

    def __init__(self, elements: Sequence[Any] = (), **values: float) -> None:
        super().__init__(elements, **values)
        bank = sum(k * r for k, r in self.elements)
        highest = max(self.values["coulomb"], self.values["static"])
        if bank < highest * (1.0 - 1e-9):
            raise ConfigError(
                f"modified-leuven: its elements yield at {bank:g} N, below the level of {highest:g} N; "
                f"sum of stiffness * reach must be at least {highest:g} N"
            )

    def vector(self) -> Floats:
        """Return the plain parameters, count, elements and the stiffness with every element sticking."""
        return np.append(super().vector(), sum(k for k, _ in self.elements))

    def initial_state(self) -> Floats:
        """Return the elements' deflections, all relaxed, and no motion within the grain."""
        return np.zeros(len(self.elements) + 2)

    def stiffness(self) -> float:
        """Return twice the bank's stiffness, reached just after a reversal out of sliding (N/m)."""
        return 2.0 * float(sum(k for k, _ in self.elements))

    def damping(self) -> float:
        """Return twice sigma_1, reached like the stiffness, and sigma_2 (N s/m)."""
        return 2.0 * self.values["damping"] + self.values["viscous"]
