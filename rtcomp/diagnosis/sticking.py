"""Force of friction that no motion tells: the axis sticks finer than its sensor sees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.recording.reader import Recording
from rtcomp.stage.stage import Stage

MUCH = 0.03
"""Part of the drive's force (rms). Where noise makes more of a balance of forces, and friction that no motion
tells may make more too, the balance is no judge."""


def untold(stage: Stage, reading: Floats, voltage: Floats) -> Floats:
    """Return how far apart the forces (N) lie, (K,), that a row's reading leaves open to friction.

    In a stretch in which the reading stays within one and a half counts of the sensor, what friction did left
    no trace: it went along with the drive's force, over as much as that went up and down, or over all that
    friction can do.
    """
    friction = stage.friction
    level = friction.level if isinstance(friction, MaxwellSlip) else 0.0
    count = max(stage.sensor.resolution, 4.0 * stage.sensor.noise)  # m
    out = np.zeros(reading.size)
    if count > 0.0 and level > 0.0:
        force = _force(stage, voltage)
        _widths(np.ascontiguousarray(reading), force, 1.5 * count, 2.0 * level, out)
    return out


def part_untold(stage: Stage, recordings: Sequence[Recording]) -> float:
    """Return the part of the drive's force that is open so, rms over rms: evenly spread within its width."""
    open_to = sum(float(np.sum(untold(stage, r.position, r.voltage) ** 2)) / 12.0 for r in recordings)
    given = sum(float(np.sum(_force(stage, r.voltage) ** 2)) for r in recordings)
    return float(np.sqrt(open_to / max(given, 1e-300)))


def _force(stage: Stage, voltage: Floats) -> Floats:
    return stage.force_constant * np.clip(voltage, -stage.voltage_limit, stage.voltage_limit)


def sticks(untold: float, noise: float) -> bool:
    """Tell whether friction that no motion tells, and noise, each make much of a balance of forces.

    Both are parts of the drive's force (rms).
    """
    return min(untold, noise) > MUCH


def hides(untold: float, noise: float, left: float) -> bool:
    """Tell whether an axis `sticks`, and this may make half of what a balance of forces has `left`.

    Where more is left, the balance sees what is missing.
    """
    return sticks(untold, noise) and untold**2 + noise**2 > 0.5 * left**2


@compiled
def _widths(x: Floats, force: Floats, width: float, most: float, out: Floats) -> None:
    first = 0
    while first < x.size:
        low = high = x[first]
        least = largest = force[first]
        last = first + 1
        while last < x.size and max(high, x[last]) - min(low, x[last]) <= width:
            low, high = min(low, x[last]), max(high, x[last])
            least, largest = min(least, force[last]), max(largest, force[last])
            last += 1
        out[first:last] = min(largest - least, most)
        first = last
