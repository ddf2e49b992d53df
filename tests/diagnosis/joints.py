"""A geared joint behind a coarse encoder, and a motion of it."""

from __future__ import annotations

import numpy as np
from recorded import RATE

from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

MASS = 0.024
FRICTION = [
    {"stiffness": 780.0, "reach": 4.6e-4},
    {"stiffness": 110.0, "reach": 1.16e-3},
    {"stiffness": 25.0, "reach": 2.9e-3},
    {"stiffness": 13.0, "reach": 7.4e-3},
]


def joint(resolution: float, mass: float = MASS, *effects: dict[str, float | str]) -> Stage:
    """A geared joint; its friction yields within a few counts."""
    made = {"axis": "rotary", "mass": mass, "force_constant": 1.5, "voltage_limit": 1.3, "viscous": 0.08}
    return Stage.from_dict(
        {
            "stage": {**made, "friction": FRICTION, "effects": list(effects)},
            "sensor": {"noise": 0.0, "resolution": resolution},
            "controller": {"kp": 13.0, "ki": 75.0, "kd": 0.65},
            "rate": RATE,
        }
    )


def swings(seconds: float = 20.0) -> Floats:
    t = np.arange(int(seconds * RATE)) / RATE
    waves = 0.6 * np.sin(2 * np.pi * 0.23 * t) + 0.4 * np.sin(2 * np.pi * 0.41 * t + 1.0)
    return np.asarray((1.0 - np.exp(-t / 0.3)) * (waves + 0.1 * np.sin(2 * np.pi * 0.05 * t)))
