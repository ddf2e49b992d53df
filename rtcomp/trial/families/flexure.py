"""Flexures: a mass on leaf springs, hardly damped, with a thousandth of friction or none."""

from __future__ import annotations

import math

import numpy as np

from rtcomp.trial.axis import Loop, Physics
from rtcomp.trial.families.family import (
    FRICTIONLESS,
    NO_FRICTION_VALUES,
    Family,
    Motion,
    believed_springs,
    log_uniform,
)
from rtcomp.trial.stagefile import Believed

NONE = 1e-6
"""Friction over the spring's force at full stroke where there is none."""


def draw_stage(chance: np.random.Generator) -> tuple[Loop, Physics, Motion]:
    """Draw a flexure, its loop with a bandwidth above its resonance, and how it is to move."""
    rate = float(chance.choice([2000.0, 4000.0]))
    mass, stroke = log_uniform(chance, 0.3, 3.0), log_uniform(chance, 5e-5, 4e-4)
    own = 2.0 * math.pi * log_uniform(chance, 6.0, 25.0)
    spring = mass * own**2
    edge = spring * stroke
    share = NONE if chance.random() < 0.5 else log_uniform(chance, 2e-3, 8e-3)
    fastest = own / (2.0 * math.pi) * chance.uniform(0.6, 1.3)
    speed = 0.3 * stroke * 2.0 * math.pi * 0.5 * fastest
    force_constant = 2.5 * edge / chance.uniform(3.0, 6.0)
    physics = Physics(
        mass, force_constant, 10.0, 2.0 * log_uniform(chance, 0.005, 0.03) * mass * own, 0.0, 0.3 * speed,
        share * edge, stroke / chance.uniform(8.0, 30.0), chance.uniform(2.5, 5.0), spring=spring,
    )  # fmt: skip
    omega = min(own * chance.uniform(2.0, 3.5), rate / 8.0)
    damping = 2.0 * chance.uniform(0.5, 0.8) * mass * omega
    kp = mass * (omega**2 - own**2)
    # A quarter of the integral gain at which the loop would begin to swing.
    ki = chance.uniform(0.15, 0.3) * damping * omega**2
    resolution, noise = float(chance.choice([1e-9, 5e-9])), log_uniform(chance, 2e-9, 1e-8)
    gains = (kp / force_constant, ki / force_constant, damping / force_constant)
    seconds = chance.uniform(15.0, 30.0)
    motion = {"seconds": seconds, "stroke": stroke, "reach": physics.reach, "fastest": fastest}
    return Loop(*gains, rate, noise, resolution), physics, motion


def belief(physics: Physics, chance: np.random.Generator) -> Believed:
    """Draw a belief; friction that is not there is not believed."""
    believed = believed_springs(physics, chance)
    if physics.level > 2.0 * NONE * physics.spring * physics.reach * 30.0:
        return believed
    return Believed(believed.physics, ())


FAMILY = Family(
    "flexure", "mass on leaf springs, hardly any friction", draw_stage, belief=belief,
    # Without friction another scale of the sensor is another gain.
    lacks=FRICTIONLESS | NO_FRICTION_VALUES | {"sensor-scale"},
)  # fmt: skip
