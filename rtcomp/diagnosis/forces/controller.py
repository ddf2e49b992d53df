"""The stage's own controller, its derivative filtered as the recorded command shows it.

A stage file states gains. How the derivative is filtered decides how loud a coarse sensor is in the command,
so a replicate needs it, and the command that was recorded beside reading and reference tells.
"""

from __future__ import annotations

import numpy as np

from rtcomp.control.pid import INTEGRAL_LIMIT, POLE, STATES, Derivative, pid_preset, pid_step, pid_vector
from rtcomp.diagnosis.forces.readings import EXCERPT
from rtcomp.diagnosis.recordings.data import Segment
from rtcomp.kernels import Floats, compiled
from rtcomp.stage.stage import Stage

INPUTS: tuple[Derivative, ...] = ("error", "measurement")
"""What the derivative is of."""


def gains(stage: Stage, period: float, segment: Segment | None = None) -> Floats:
    """Return the parameters of `pid_step` for a stage with a controller.

    The filter of the derivative, and whether that is of the error or the reading, are those that come nearest
    to the command of a `segment`; without one, those of our own loop.
    """
    from scipy.optimize import minimize_scalar

    c = stage.controller
    assert c is not None

    def made(of: Derivative) -> Floats:
        limit = stage.voltage_limit
        return pid_vector(c.kp, c.ki, c.kd, period=period, derivative=of, voltage_limit=limit)

    if segment is None or segment.reference is None or c.kd == 0.0:
        return made(INPUTS[0])
    target, read, volts = (a[:EXCERPT] for a in (segment.reference, segment.position, segment.voltage))

    def apart(pole: float, one: Floats) -> float:
        one[POLE] = pole
        return float(np.var(np.diff(_commanded(one, target, read, float(volts[0])) - volts)))

    found = []
    for one in map(made, INPUTS):
        best = minimize_scalar(apart, bounds=(0.0, 1.0), args=(one,), method="bounded")
        found.append((apart(best.x, one), one))
    return min(found, key=lambda each: each[0])[1]


@compiled
def _commanded(p: Floats, target: Floats, read: Floats, first: float) -> Floats:
    """Return what a controller commands (V, (K,)) where `read` (m, (K,)) should be `target` (m, (K,))."""
    state, out, excess = np.zeros(STATES), np.empty(target.size), 0.0
    pid_preset(p, state, target[0] - read[0], read[0], first)
    for k in range(target.size):
        asked = pid_step(p, state, target[k] - read[k], read[k], excess)
        out[k] = min(max(asked, -p[INTEGRAL_LIMIT]), p[INTEGRAL_LIMIT])
        excess = out[k] - asked
    return out
