"""The stage's own controller, its derivative filtered as the recorded command shows it.

A stage file states gains. How the derivative is filtered decides how loud a coarse sensor is in the command,
so a replicate needs it, and the command that was recorded beside reading and reference tells.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from rtcomp.control.pid import INTEGRAL_LIMIT, STATES, Derivative, pid_preset, pid_step, pid_vector
from rtcomp.diagnosis.recordings.data import Segment
from rtcomp.kernels import Floats, compiled
from rtcomp.stage.stage import Stage

FILTERS = (2.0, 0.0, 0.5, 1.0, 4.0, 8.0, 16.0)
"""Time constants of the filter, in periods; the first is that of our own loop."""
ROWS = 20_000
"""Rows that are looked at, at most."""
INPUTS: tuple[Derivative, ...] = ("error", "measurement")
"""What the derivative is of."""


def gains(stage: Stage, period: float, segment: Segment | None = None) -> Floats:
    """Return the parameters of `pid_step` for a stage with a controller, as near to a segment's command."""
    c = stage.controller
    assert c is not None

    def made(of: Derivative, filtering: float) -> Floats:
        return pid_vector(
            c.kp, c.ki, c.kd, period=period, derivative=of, derivative_time=filtering * period,
            voltage_limit=stage.voltage_limit,
        )  # fmt: skip

    plain = made(INPUTS[0], FILTERS[0])
    if segment is None or segment.reference is None or c.kd == 0.0:
        return plain
    target, read, volts = (a[:ROWS] for a in (segment.reference, segment.position, segment.voltage))

    def apart(one: Floats) -> float:
        return float(np.var(np.diff(_commanded(one, target, read, float(volts[0])) - volts)))

    return min((made(of, filtering) for of, filtering in product(INPUTS, FILTERS)), key=apart)


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
