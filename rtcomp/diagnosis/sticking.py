"""Rows in which friction cannot be told from the motion: the axis sticks finer than its sensor sees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.recording.reader import Recording
from rtcomp.stage.stage import Stage

CHANGE = 0.2
"""Part of friction's level by which the drive's force changes while the position stays within a count."""
MUCH = 0.2
"""Part of the rows in which it does, from which on a balance of forces does not decide anything."""


def hidden(stage: Stage, reading: Floats, voltage: Floats, count: float) -> np.ndarray:
    """Return the rows (K,) bool of stretches that tell nothing of friction.

    In such a stretch the reading stays within one and a half counts (`count`, m) while the drive's force goes
    up or down by CHANGE of friction's level: the friction that balanced it left no trace in the motion.
    """
    friction = stage.friction
    level = friction.level if isinstance(friction, MaxwellSlip) else 0.0
    if count <= 0.0 or level <= 0.0:
        return np.zeros(reading.size, dtype=np.bool_)
    force = stage.force_constant * np.clip(voltage, -stage.voltage_limit, stage.voltage_limit)
    out = np.zeros(reading.size, dtype=np.bool_)
    _mark(np.ascontiguousarray(reading), force, 1.5 * count, CHANGE * level, out)
    return out


@compiled
def _mark(x: Floats, force: Floats, width: float, change: float, out: np.ndarray) -> None:
    first = 0
    while first < x.size:
        low = high = x[first]
        least = most = force[first]
        last = first + 1
        while last < x.size and max(high, x[last]) - min(low, x[last]) <= width:
            low, high = min(low, x[last]), max(high, x[last])
            least, most = min(least, force[last]), max(most, force[last])
            last += 1
        if most - least > change:
            out[first:last] = True
        first = last


def count_of(stage: Stage) -> float:
    """Return what of a motion the sensor does not see (m): its count, or where that is not said its noise."""
    return max(stage.sensor.resolution, 4.0 * stage.sensor.noise)


def mostly_hidden(stage: Stage, recordings: Sequence[Recording]) -> float:
    """Return the part of all rows that is hidden."""
    count = count_of(stage)
    marked = [hidden(stage, r.position, r.voltage, count) for r in recordings]
    return float(sum(int(m.sum()) for m in marked)) / max(sum(m.size for m in marked), 1)
