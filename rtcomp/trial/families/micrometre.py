"""Stages of micrometre precision with friction, as they stand in laboratories."""

from __future__ import annotations

import math

import numpy as np

from rtcomp.trial.axis import Loop, Physics
from rtcomp.trial.families.family import Family, Motion, log_uniform


def draw_stage(chance: np.random.Generator) -> tuple[Loop, Physics, Motion]:
    """Draw a stage, its loop and how it is to move: what a laboratory might have on its table."""
    kind = chance.choice(["interferometer", "encoder", "worse"], p=[0.5, 0.4, 0.1])
    rate = float(chance.choice([500.0, 1000.0, 2000.0, 4000.0], p=[0.15, 0.55, 0.2, 0.1]))
    if kind == "interferometer":
        noise, resolution = log_uniform(chance, 8e-9, 2.5e-8), float(chance.choice([1e-9, 5e-9, 1e-8]))
    elif kind == "encoder":
        noise, resolution = log_uniform(chance, 1e-8, 4e-8), 1e-7
    else:
        resolution = log_uniform(chance, 2e-7, 8e-7)
        noise, rate = 0.3 * resolution, min(rate, 1000.0)
    while True:
        mass, level = log_uniform(chance, 0.5, 5.0), log_uniform(chance, 1.0, 10.0)
        # How fast friction alone could stop the mass within the stroke sets the pace of everything.
        pace = log_uniform(chance, 25.0, min(80.0, rate / 16.0 + 1.0))
        stroke = level / (mass * pace**2)
        reach = stroke / log_uniform(chance, 8.0, 40.0)
        if max(2e-6, 60.0 * max(noise, resolution)) <= reach <= 1e-4:
            break
    shape = chance.uniform(2.5, 5.0)
    # Inertia asks for half to twice the friction at the fastest.
    fastest = pace * math.sqrt(chance.uniform(0.5, 2.0)) / (2.0 * math.pi)
    seconds = min(chance.uniform(20.0, 60.0), 120_000.0 / rate)
    motion = {"seconds": seconds, "stroke": stroke, "reach": reach, "fastest": fastest}
    speed = 0.3 * stroke * 2.0 * math.pi * 0.5 * fastest
    force_constant = level / chance.uniform(0.4, 1.5)
    stiffness = level * shape / reach
    micro = 2.0 * chance.uniform(0.05, 0.2) * math.sqrt(stiffness * mass)
    # The damping of presliding fades before it would be a friction of its own.
    micro_speed = min(speed * chance.uniform(0.2, 0.6), 0.3 * level / micro)
    physics = Physics(
        mass, force_constant, 10.0, level * chance.uniform(0.03, 0.2) / speed, micro, micro_speed,
        level, reach, shape,
    )  # fmt: skip
    omega = min(pace * math.sqrt(chance.uniform(6.0, 15.0)), rate / 5.0)
    kp = mass * omega**2 / force_constant
    kd = 2.0 * chance.uniform(0.4, 0.7) * mass * omega / force_constant
    return Loop(kp, kp * chance.uniform(5.0, 12.0), kd, rate, noise, resolution), physics, motion


FAMILY = Family("micrometre", "stage of micrometre precision with friction", draw_stage, forms=0.0)
