"""What a play leaves behind: the path of the load."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.physics.coupled import contact

FINE = 0.3
"""Longest sub-step (rad) of the load's oscillation behind a play."""


@dataclass(frozen=True)
class Load:
    """What is behind a play: its friction and inertia, and how it meets the ends."""

    mass: float
    viscous: float
    micro_damping: float
    micro_speed: float
    stiffness: Floats
    """(n,) N/m of stop elements, with `reaches` (n,) m."""
    reaches: Floats


def behind_play(x: Floats, period: float, gap: float, contact_hz: float, load: Load) -> Floats:
    """Return the position (m) of a load that `x` (m, rows of `period` s) drives through a play of +-`gap`.

    The load's equation of motion, in sub-steps of its fastest oscillation: friction against the contact of
    either end, which gives way and does not pull. Where neither end holds it, it stays, or flies on.
    """
    omega = 2.0 * math.pi * contact_hz
    held = math.sqrt(omega**2 + float(np.sum(load.stiffness)) / load.mass)
    parts = max(1, math.ceil(period * held / FINE))
    return _drawn(
        x, period / parts, parts, gap, omega, load.mass, load.viscous, load.micro_damping, load.micro_speed,
        load.stiffness, load.reaches,
    )  # fmt: skip


@compiled
def _drawn(
    x: Floats, h: float, parts: int, gap: float, omega: float, mass: float, viscous: float, micro: float,
    micro_speed: float, stiffness: Floats, reaches: Floats,
) -> Floats:  # fmt: skip
    out = np.empty_like(x)
    z = np.zeros_like(reaches)
    y, u = x[0], 0.0
    out[0] = y
    for k in range(1, x.size):
        base = (x[k] - x[k - 1]) / (h * parts)
        for j in range(parts):
            at = x[k - 1] + base * j * h  # where the load is, too: speeds are half a step on
            friction = 0.0
            for i in range(z.size):
                friction += stiffness[i] * z[i]
            ratio = u / micro_speed
            damping = viscous + micro * math.exp(-ratio * ratio)
            u += h * (contact(y - at, u - base, gap, omega) - friction / mass)
            u /= 1.0 + h * damping / mass
            for i in range(z.size):
                z[i] = min(max(z[i] + h * u, -reaches[i]), reaches[i])
            y += h * u
        out[k] = y
    return out
