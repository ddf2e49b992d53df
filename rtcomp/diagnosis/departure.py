"""How far a fit takes the believed numbers: beliefs are off by a tenth, not by a third all at once."""

from __future__ import annotations

import numpy as np

from rtcomp.diagnosis.base import FIXED, Fitted
from rtcomp.diagnosis.extend import level_and_reach
from rtcomp.kernels import Floats
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.stage.stage import Stage

USUAL = 0.08
"""How far off (logarithm) a believed number usually is."""


def believed_friction(stage: Stage) -> tuple[float, float]:
    """Return friction.level (N) and friction.reach (m) of the belief; 0 where it has no stop elements."""
    friction = stage.friction
    return level_and_reach(friction.elements) if isinstance(friction, MaxwellSlip) else (0.0, 0.0)


def off(fitted: Fitted) -> Floats:
    """Return the logarithms of refitted over believed numbers (5,), in units of USUAL.

    Those of mass, viscous friction, micro-damping, and level and reach of friction; 0 where none is believed.
    """
    stage, reaches = fitted.ledger.stage, fitted.ledger.reaches
    c, m = fitted.coefficients, stage.mechanics
    pairs = [(c[0], stage.mass), (c[1], m.viscous), (c[2], m.micro_damping)]
    found = level_and_reach(list(zip(c[FIXED : FIXED + reaches.size], reaches, strict=True)))
    pairs += list(zip(found, believed_friction(stage), strict=True))
    logs = [np.log(max(now, 1e-3 * was) / was) / USUAL if was > 0 else 0.0 for now, was in pairs]
    # What an entry has released says nothing for or against it.
    free = np.isinf(fitted.bounds.high[:FIXED])
    return np.array([0.0 if i < FIXED and free[i] else log for i, log in enumerate(logs)])


def departure(fitted: Fitted) -> float:
    """Return the squared distance of the refitted numbers from the believed ones, 0 where all are usual."""
    return float(np.sum(np.maximum(np.abs(off(fitted)) - 1.0, 0.0) ** 2))
