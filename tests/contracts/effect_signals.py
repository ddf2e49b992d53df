"""Motion on which contracts of effects are tried, and the signals of a plain stage with effects in it."""

from __future__ import annotations

import numpy as np

from rtcomp import physics
from rtcomp.physics.drive import DriveForce
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.physics.rows import motion_rows, over_rows
from rtcomp.physics.wires import (
    ACCELERATION,
    DRIVE,
    FRICTION,
    GAIN,
    MASS,
    NOISE,
    PUSH,
    SENSED,
    TIME,
    VELOCITY,
    VOLTS,
)

SIGNALS = [VOLTS, DRIVE, PUSH, FRICTION, MASS, GAIN, SENSED]


def motion(seed: int = 0) -> np.ndarray:
    """Rows of 4 s at 1 kHz: micrometres with nested reversals, then +-1 mm at up to 50 mm/s, at up to 8 V."""
    random = np.random.default_rng(seed)
    t = np.arange(1, 4001) * 1e-3
    small = 20e-6 * np.sin(2 * np.pi * 0.5 * t) * np.sin(2 * np.pi * 3 * t)
    chirp = 2 * np.pi * (0.5 * (t - 2) + 1.9 * (t - 2) ** 2)
    large = np.where(t > 2, 1e-3 * np.sin(chirp), 0.0)
    volts = 5 * np.sin(2 * np.pi * 1.7 * t + seed) + 3 * np.sin(2 * np.pi * 13 * t)
    rows = motion_rows(small + large, 1e-3, volts)
    rows[:, MASS], rows[:, GAIN], rows[:, NOISE] = 2.0, 4.0, random.standard_normal(len(t))
    return rows


MOTION = motion()


def chain_of(*effects):
    """The effects in a plain stage with friction."""
    viscous = physics.build({"name": "viscous-friction", "coefficient": 20.0})
    stage = [DriveForce(), MaxwellSlip([(8e5, 2e-6), (4e5, 7e-6)]), viscous]
    companions = [c for e in effects for c in e.companions()]
    return sorted([*effects, *companions, *stage], key=lambda e: (e.place, e.order))


def signals(*effects, rows=MOTION):
    return over_rows(chain_of(*effects), rows.copy())[:, SIGNALS]


def smooth_motion() -> np.ndarray:
    """Rows of 0.4 s at 20 kHz: from rest over 1 mm, presliding loops on it, and a command that does not jump.

    They start at 2.1 s, so that a jump falls into them.
    """
    t = np.arange(1, 8001) * 5e-5
    x = 5e-4 * (1 - np.cos(2 * np.pi * 3 * t)) + 2e-6 * (1 - np.cos(2 * np.pi * 37 * t))
    rows = motion_rows(x, 5e-5, 5 * np.sin(2 * np.pi * 5 * t) + 2 * np.sin(2 * np.pi * 13 * t))
    rows[:, ACCELERATION] = np.gradient(rows[:, VELOCITY], 5e-5)
    rows[:, TIME] += 2.1
    rows[:, MASS], rows[:, GAIN] = 2.0, 4.0
    return rows


SMOOTH = smooth_motion()
