"""Geared joints: a rotary axis with a 12-bit encoder that carries a pendulum, or is balanced."""

from __future__ import annotations

import math

import numpy as np

from rtcomp.trial.axis import Loop, Physics
from rtcomp.trial.families.family import Family, Motion, believed_springs, log_uniform, pid

COUNT = 2.0 * math.pi / 4096.0
"""rad, of a 12-bit encoder."""


def draw_stage(chance: np.random.Generator) -> tuple[Loop, Physics, Motion]:
    """Draw a joint (rad, N m, kg m^2), its loop and how it is to move."""
    rate = float(chance.choice([200.0, 250.0]))
    inertia, level = log_uniform(chance, 0.01, 0.05), log_uniform(chance, 0.15, 0.6)
    weight = log_uniform(chance, 0.3, 1.5) if chance.random() < 0.5 else 0.0
    stroke = chance.uniform(0.6, 1.4)
    pace = math.sqrt((level + 0.5 * weight) / (inertia * stroke))
    fastest = pace * math.sqrt(chance.uniform(0.5, 2.0)) / (2.0 * math.pi)
    speed = 0.3 * stroke * math.pi * fastest
    reach, shape = log_uniform(chance, 0.01, 0.04), chance.uniform(2.5, 5.0)
    peak = 2.0 * level + weight
    micro = 2.0 * chance.uniform(0.05, 0.2) * math.sqrt(level * shape / reach * inertia)
    physics = Physics(
        inertia, peak / chance.uniform(3.0, 6.0), 12.0, level * chance.uniform(0.05, 0.4) / speed, micro,
        min(0.4 * speed, 0.3 * level / micro), level, reach, shape,
        pendulum=weight, pendulum_phase=chance.uniform(0.0, 2.0 * math.pi),
    )  # fmt: skip
    # A count in one tick kicks with at most half of the friction.
    kick = 0.5 * level / (1.1 * inertia * COUNT * rate)
    omega = min(2.0 * pace * math.sqrt(chance.uniform(6.0, 15.0)), rate / 10.0, kick)
    gains = pid(chance, physics, omega, (3.0, 6.0))
    seconds = chance.uniform(30.0, 60.0)
    motion = {"seconds": seconds, "stroke": stroke, "reach": reach, "fastest": fastest}
    cut = min(0.1 * rate, 6.0 * fastest)
    return Loop(*gains, rate, 0.1 * COUNT, COUNT, cut=cut), physics, motion


FAMILY = Family(
    "geared-joint", "rotary axis, 12-bit encoder, a pendulum's weight", draw_stage, belief=believed_springs,
    rotary=True,
)  # fmt: skip
