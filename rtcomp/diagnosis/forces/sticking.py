"""Force of friction that no motion tells, and what each row of a force balance counts for it.

Where the reading stays on a count of the sensor, friction goes along with the drive's force unseen. What it
may have done there adds to the residual beside the sensor's noise. Noise that is finer than that is smoothed,
and what it does to friction is part of that of the residual.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtcomp.kernels import Floats, compiled

if TYPE_CHECKING:
    from rtcomp.diagnosis.forces.balance import ForceBalance

DRAWS = 16
"""Draws of what friction did unseen: their mean square is its power."""
COUNTS = 1.5
"""How far a reading may go about at rest, in counts of the sensor."""


def trust(balance: ForceBalance) -> Floats:
    """Return the weight of each compared row, (n,): 1 where motion tells what friction does.

    Else residuals there have the variance of noise, 1, and that of what friction may have done besides:
    weighted least squares. It followed the drive's force, up or down, by as much as that went up and down in
    a stretch of rest, or by all that friction can do.
    """
    if balance.stage.sensor.resolution == 0.0:
        return np.ones(balance.plain([s.time for s in balance.data.segments]).size)
    random = np.random.default_rng(7)
    unseen = [
        random.choice((-1.0, 1.0), (int(stretch[-1]) + 1, DRAWS))[stretch] * course[:, None]
        for course, stretch in _unseen(balance)
    ]
    return np.asarray(1.0 / np.sqrt(1.0 + np.mean(balance.compared(unseen) ** 2, axis=0)))


def untold(balance: ForceBalance) -> float:
    """Return the part of the drive's force (rms) that friction may have made unseen."""
    unseen = np.concatenate([course for course, _ in _unseen(balance)])
    given = np.concatenate([_drive_of(balance, s.voltage) for s in balance.data.segments])
    return float(np.sqrt(np.sum(unseen**2) / max(float(np.sum(given**2)), 1e-300)))


def _drive_of(balance: ForceBalance, voltage: Floats) -> Floats:
    """Return the force (N) of the believed drive at a voltage (V)."""
    stage = balance.stage
    return np.asarray(stage.force_constant * np.clip(voltage, -stage.voltage_limit, stage.voltage_limit))


def _unseen(balance: ForceBalance) -> list[tuple[Floats, np.ndarray]]:
    """Return `courses` of each segment, as far as friction is known to go."""
    width, read = COUNTS * balance.stage.sensor.resolution, balance.data.segments
    return [courses(s.position, _drive_of(balance, s.voltage), width, balance.level) for s in read]


def courses(x: Floats, force: Floats, width: float, most: float) -> tuple[Floats, np.ndarray]:
    """Return what friction may have done unseen in each row (N, (K,)), and its stretch of rest, (K,).

    In a stretch the position `x` (m, (K,)) stays within `width` (m). There friction went along with the
    `force` (N, (K,)), from the middle of what that did at most as far as `most` (N).
    """
    course, stretch = np.zeros(force.size), np.zeros(force.size, np.int64)
    _courses(np.ascontiguousarray(x), force, width, most, course, stretch)
    return course, stretch


@compiled
def _courses(
    x: Floats, force: Floats, width: float, most: float, course: Floats, stretch: np.ndarray
) -> None:
    first, number = 0, 0
    while first < x.size:
        low = high = x[first]
        least = largest = force[first]
        last = first + 1
        while last < x.size and max(high, x[last]) - min(low, x[last]) <= width:
            low, high = min(low, x[last]), max(high, x[last])
            least, largest = min(least, force[last]), max(largest, force[last])
            last += 1
        middle = 0.5 * (least + largest)
        for k in range(first, last):
            course[k] = min(max(force[k] - middle, -most), most)
            stretch[k] = number
        first, number = last, number + 1
