"""Voice coils: light, fast, at 10 kHz."""

from __future__ import annotations

import math

import numpy as np

from rtcomp.trial.axis import Loop, Physics
from rtcomp.trial.families.family import Family, Motion, log_uniform, pid


def draw_stage(chance: np.random.Generator) -> tuple[Loop, Physics, Motion]:
    """Draw a voice coil, its loop and how it is to move."""
    rate = 10_000.0
    mass, stroke = log_uniform(chance, 0.05, 0.4), log_uniform(chance, 3e-4, 3e-3)
    fastest = log_uniform(chance, 10.0, 40.0)
    inertial = mass * stroke * (2.0 * math.pi * fastest) ** 2
    speed = 0.3 * stroke * math.pi * fastest
    level, shape = inertial * chance.uniform(0.05, 0.25), chance.uniform(2.5, 5.0)
    resolution, noise = float(chance.choice([1e-9, 5e-9, 1e-8])), log_uniform(chance, 2e-9, 1e-8)
    reach = log_uniform(chance, max(3e-6, 100.0 * max(resolution, noise)), 2e-5)
    micro = 2.0 * chance.uniform(0.05, 0.2) * math.sqrt(level * shape / reach * mass)
    physics = Physics(
        mass, inertial / chance.uniform(2.0, 5.0), 10.0, level * chance.uniform(0.1, 0.6) / speed, micro,
        min(0.4 * speed, 0.3 * level / micro), level, reach, shape,
    )  # fmt: skip
    omega = min(2.0 * math.pi * fastest * chance.uniform(3.0, 5.0), rate / 8.0)
    gains = pid(chance, physics, omega, (5.0, 20.0))
    seconds = chance.uniform(6.0, 10.0)
    motion = {"seconds": seconds, "stroke": stroke, "reach": reach, "fastest": fastest}
    return Loop(*gains, rate, noise, resolution), physics, motion


FAMILY = Family("voice-coil", "fast voice coil at 10 kHz", draw_stage)
