"""Force of friction that no motion tells, and what each row of a force balance counts for it.

Where the reading stays on a count of the sensor, friction goes along with the drive's force unseen. What it
may have done there adds to the residual beside the sensor's noise. Noise that is finer than that is smoothed,
and what it does to friction is part of that of the residual.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rtcomp.diagnosis.recordings.counts import counted
from rtcomp.kernels import Floats, compiled

if TYPE_CHECKING:
    from rtcomp.diagnosis.forces.balance import ForceBalance

DRAWS = 16
"""Draws of what friction did unseen: their mean square is its power."""
COUNTS = 1.5
"""How far a reading may go about at rest, in counts of the sensor."""


@dataclass(frozen=True)
class RestWeights:
    """Weights of the compared rows of a force balance, where friction may have acted unseen.

    Friction followed the drive's force, up or down, by as much as that went up and down in a stretch of rest,
    or by all that it can do. Residuals of a stretch have the variance of noise, 1, and that of this course:
    generalised least squares (Aitken 1935). However many rows a stretch has, it is one unknown.
    """

    trust: Floats
    """Weight of each row, (n,): 1 where the motion determines the friction force."""
    along: Floats
    """Scaled course of each stretch, (n,): weighed rows lose their projection on it in part."""
    first: np.ndarray
    """First row of each stretch, and n."""

    @classmethod
    def of(cls, balance: ForceBalance) -> RestWeights:
        """Return the weights of a balance that has none yet."""
        if counted(balance.stage, balance.data) == 0.0:
            rows = balance.plain([s.time for s in balance.data.segments]).size
            return cls(np.ones(rows), np.zeros(rows), np.array([0, rows]))
        random, unseen = np.random.default_rng(7), _unseen(balance)
        drawn = [
            random.choice((-1.0, 1.0), (int(stretch[-1]) + 1, DRAWS))[stretch] * course[:, None]
            for course, stretch in unseen
        ]
        trust = 1.0 / np.sqrt(1.0 + np.mean(balance.compared(drawn) ** 2, axis=0))
        course = trust * balance.compared([course for course, _ in unseen])[0]
        befores = np.cumsum([0.0, *(1.0 + stretch[-1] for _, stretch in unseen)])
        stretch = balance.plain([n + stretch for n, (_, stretch) in zip(befores, unseen, strict=False)])
        begins = (np.diff(stretch) != 0.0) | (np.diff(balance.block) != 0)
        first = np.concatenate([[0], np.flatnonzero(begins) + 1, [course.size]])
        return cls(trust, along(course, first), first)

    @cached_property
    def by_row(self) -> Floats:
        """Factor of each row, (n,): its trust, and all that a stretch of a single row loses."""
        alone = np.repeat(np.diff(self.first) == 1, np.diff(self.first))
        return np.asarray(self.trust * np.where(alone, 1.0 - self.along**2, 1.0))

    @cached_property
    def longer(self) -> np.ndarray:
        """First row of each stretch of several rows, and the one after its last, (S, 2)."""
        both = np.column_stack([self.first[:-1], self.first[1:]])
        return np.ascontiguousarray(both[np.diff(self.first) > 1])

    def weigh(self, rows: Floats) -> None:
        """Weigh filtered rows (p, n), in place."""
        rows *= self.by_row
        _moved(rows, self.along, self.longer, False)

    def unweigh(self, rows: Floats) -> None:
        """Undo `weigh` on rows (p, n), in place."""
        _moved(rows, self.along, self.longer, True)
        rows /= self.by_row


def along(course: Floats, first: np.ndarray) -> Floats:
    """Return `RestWeights.along` (n,) of the `course` (n,) of stretches that begin at `first`."""
    power = np.add.reduceat(course**2, first[:-1])
    size = (1.0 - 1.0 / np.sqrt(1.0 + power)) / np.maximum(power, 1e-300)
    return np.asarray(course * np.repeat(np.sqrt(size), np.diff(first)))


@compiled
def _moved(rows: Floats, along: Floats, stretches: np.ndarray, back: bool) -> None:
    """Apply ``I - along along^T`` to stretches of rows, or `back` its inverse (Sherman, Morrison 1950)."""
    for row in rows:
        for one in range(stretches.shape[0]):
            first, last = stretches[one]
            part = power = 0.0
            for k in range(first, last):
                part += along[k] * row[k]
                power += along[k] ** 2
            if part != 0.0:
                size = part / (1.0 - power) if back else -part
                for k in range(first, last):
                    row[k] += size * along[k]


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
    width, read = COUNTS * counted(balance.stage, balance.data), balance.data.segments
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
