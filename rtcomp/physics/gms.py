"""Generalised Maxwell-slip friction: stop elements whose yield level falls with speed, late."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Parameter, Place
from rtcomp.physics.level import LEVEL, VISCOUS, speed_midway, stribeck_level, viscous_speed
from rtcomp.physics.lists import ListEffect
from rtcomp.physics.softening import softened
from rtcomp.physics.wires import (
    FRICTION,
    GRIP,
    GRIP_LEVEL,
    GRIP_STIFFNESS,
    MOVED,
    REACH,
    SCALE,
    SOFTENS,
    STEP,
)  # fmt: skip


@effect_kernel
def gms(p: Floats, s: Floats, w: Floats) -> None:
    """p: coulomb, static, Stribeck velocity, exponent, attraction, viscous, count, stiffness and weight each,
    then the whole stiffness.

    s: force (N) of each element, then the direction in which each slips (0 while it sticks). At constant
    speed both laws have closed forms: the step is sticking up to the yield point, then slipping for the rest.
    """
    moved = w[MOVED]
    count = int(p[6])
    force = 0.0
    nominal = stribeck_level(p[0], p[1], p[2], p[3], speed_midway(w))
    if moved == 0.0:  # at rest there is no direction: elements keep what they have
        for i in range(count):
            force += softened(s[i], p[8 + 2 * i] * nominal * w[REACH], w[SOFTENS])
    else:
        level = nominal * w[REACH]
        direction = math.copysign(1.0, moved)
        relax = p[4] * w[STEP] / level
        for i in range(count):
            yielding = p[8 + 2 * i] * level
            slipping = 1.0  # share of the step spent slipping
            along = s[i] * direction
            if s[count + i] != direction:
                stiffness = p[7 + 2 * i]
                free = (yielding - along) / stiffness  # travel left before it yields
                if free >= abs(moved):
                    along += stiffness * abs(moved)
                    s[count + i] = 0.0
                    slipping = 0.0
                else:
                    if free > 0.0:
                        along = yielding
                        slipping = 1.0 - free / abs(moved)
                    s[count + i] = direction
            if slipping > 0.0:
                along = yielding + (along - yielding) * math.exp(-relax * slipping)
            s[i] = along * direction
            force += softened(s[i], yielding, w[SOFTENS])
    w[GRIP] = force * w[SCALE]
    w[GRIP_LEVEL] = nominal
    w[GRIP_STIFFNESS] = p[7 + 2 * count]
    w[FRICTION] += w[GRIP] + p[5] * viscous_speed(w)


@register
class GeneralisedMaxwellSlip(ListEffect):
    """Stop elements that share one velocity-dependent level; `elements` is a list of {stiffness, weight}."""

    name = "gms"
    place = Place.FRICTION
    parameters = (
        *LEVEL,
        Parameter("attraction", "N/s", 0.0, 1e9, "how fast a slipping element settles", open_low=True),
        VISCOUS,
    )
    element = (
        Parameter("stiffness", "N/m", 0.0, 1e12, "spring of the element", open_low=True),
        Parameter("weight", "1", 0.0, 1.0, "its share of the level; the weights sum to 1", open_low=True),
    )
    kernel = gms
    says = "Maxwell-slip elements whose common yield level follows the Stribeck curve, and does so late"
    equation = (
        "stick: dF_i/dt = k_i v until |F_i| = a_i s(v); "
        "slip: dF_i/dt = C (sgn(v) a_i - F_i / s(v)), s > 0; sticks at reversal; F = sum F_i + c v"
    )
    source = "Al-Bender, Lampaert, Swevers (2005), IEEE TAC 50(11)"
    signature = "presliding loops with non-local memory, and friction in sliding that lags behind speed"
    experiment = "nested presliding reversals, then speeds that oscillate around the Stribeck velocity"
    example = {
        "coulomb": 3.0, "static": 4.0, "stribeck_velocity": 2e-3, "exponent": 2.0, "attraction": 60.0,
        "viscous": 5.0,
        "elements": [{"stiffness": 6e5, "weight": 0.3}, {"stiffness": 3e5, "weight": 0.7}],
    }  # fmt: skip
    linear = ("viscous",)
    searchable = False

    def __init__(self, elements: Sequence[Any] = (), **values: float) -> None:
        super().__init__(elements, **values)
        total = sum(weight for _, weight in self.elements)
        if abs(total - 1.0) > 1e-6:
            raise ConfigError(
                f"gms: the weights of its elements sum to {total:g}; they must sum to 1 (within 1e-6)"
            )

    def vector(self) -> Floats:
        """Return the plain parameters, count, elements and the stiffness with every element sticking."""
        return np.append(super().vector(), self.stiffness())

    def initial_state(self) -> Floats:
        """Return forces and slip directions, all relaxed and sticking."""
        return np.zeros(2 * len(self.elements))

    def stiffness(self) -> float:
        """Return the stiffness with every element sticking (N/m)."""
        return float(sum(k for k, _ in self.elements))

    def damping(self) -> float:
        """Return the viscous coefficient (N s/m)."""
        return self.values["viscous"]
