"""Recordings as short simulated windows: a stage let go from points all along the recording.

Where friction is stiffer than the sensor sees, the balance of forces says little: while the axis sticks,
friction is whatever the drive gives, and no recorded motion tells. A simulation sticks by itself. So the
stage is let go from points of the recording, driven by what was commanded, and judged by how far its
position is off (multiple shooting: Bock 1981; van Domselaar, Hemker 1975).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import behind_reading
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Place
from rtcomp.stage.shoot import shoot
from rtcomp.stage.stage import Stage

PERIODS = 4.0
"""Length of a window in periods of the force's bandwidth: time to break away, too short to drift off."""
COARSE = 3.0
"""Length of integration steps, in those of a simulation: windows are short, and run thousands of times."""
MOST_WINDOWS = 96
"""Of longer recordings, windows are taken evenly spread."""
GROUPS = 8
"""Groups of windows that are left out in turn."""
LEAST_ROWS = 8
"""Rows of a window, at the least."""


@dataclass(frozen=True)
class Windows:
    """Where a stage is let go in each segment of a force balance, for how many rows; which are reserved."""

    balance: ForceBalance
    starts: Sequence[np.ndarray]
    rows: int
    reserved: np.ndarray
    """(W,) bool: those in reserved blocks of the balance, in the order of the segments."""

    @classmethod
    def of(cls, balance: ForceBalance) -> Windows:
        """Cut the segments into windows, each within one block of the balance."""
        data = balance.data
        rows = max(LEAST_ROWS, round(PERIODS / balance.force_bandwidth * data.rate))
        rows = min(rows, max(LEAST_ROWS, sum(s.time.size for s in data.segments) // (2 * balance.blocks)))
        starts, blocks, before = [], [], 0
        for s in data.segments:
            at = np.arange(s.time.size)[balance.whitening.rows(s)]
            own = balance.block[before : before + at.size]
            before += at.size
            first, number = [], []
            for block in np.unique(own).tolist():
                within = at[own == block]
                some = np.arange(within[0], min(within[-1] + 2, s.time.size) - rows, rows)
                first.append(some)
                number.append(np.full(some.size, block))
            starts.append(np.concatenate(first))
            blocks.append(np.concatenate(number))
        thin = max(1, -(-sum(s.size for s in starts) // MOST_WINDOWS))
        reserved = balance.reserved[np.concatenate([b[::thin] for b in blocks])]
        return cls(balance, [s[::thin] for s in starts], rows, reserved)

    @property
    def order(self) -> np.ndarray:
        """Windows (W,) group by group: those used in turn, so that each group has a bit of every motion."""
        return np.argsort(self._group, kind="stable")

    @property
    def block(self) -> np.ndarray:
        """Return the group of each window in that order, (W,); the last is that of the reserved."""
        return np.sort(self._group)

    @property
    def _group(self) -> np.ndarray:
        used = ~self.reserved
        group = np.full(used.size, GROUPS)
        group[used] = np.arange(np.count_nonzero(used)) % GROUPS
        return group

    @property
    def seconds(self) -> float:
        """Length of a window (s)."""
        return self.rows * self.balance.data.period

    def on(self, balance: ForceBalance) -> Windows:
        """Return the same windows of other data of equal length."""
        return Windows(balance, self.starts, self.rows, self.reserved)

    def off(self, stage: Stage) -> Floats:
        """Return how far the simulated position is off, m, (W, rows); what is not finite is far.

        Where a sensor's effects are undone, the error is relative to the travel that is left: a position that
        hardly moves is easily met.
        """
        sensors = [e for e in stage.chain if e.place is Place.SENSOR]
        found, followed = [], []
        balance = self.balance
        pairs = zip(balance.data.segments, balance.paths(sensors), self.starts, strict=True)
        for segment, path, starts in pairs:
            if starts.size:
                went = np.full((starts.size, self.rows), np.inf)
                with suppress(ConfigError):  # where it would take too long
                    went = shoot(
                        stage, segment.time, path.x, path.v, segment.voltage, starts, self.rows, COARSE
                    )
                reading = behind_reading(segment, sensors)
                there = reading[starts[:, None] + np.arange(self.rows)]
                found.append(went - there)
                followed.append(there - there[:, :1])
        low, high = balance.data.stroke
        far = high - low
        off = np.nan_to_num(np.concatenate(found), nan=far, posinf=far, neginf=-far)
        if sensors:
            left = float(np.sum(np.concatenate(followed) ** 2))
            off *= np.sqrt(max(float(np.sum(self.moved() ** 2)) / max(left, 1e-300), 1.0))
        return np.asarray(np.clip(off, -far, far)[self.order])

    def forced(self) -> Floats:
        """Return how far the recorded position is from where its first speed would have led, m, (W, rows).

        So far did forces move it: an axis that runs on at its speed covers much way and shows none.
        """
        pairs = zip(self.balance.paths(), self.starts, strict=True)
        speed = np.concatenate([path.v[starts] for path, starts in pairs])[self.order]
        time = np.arange(self.rows) * self.balance.data.period
        return np.asarray(self.moved() - speed[:, None] * time)

    def moved(self) -> Floats:
        """Return how far the recorded position is from where each window begins, m, (W, rows)."""
        found = []
        for segment, starts in zip(self.balance.data.segments, self.starts, strict=True):
            rows = segment.position[starts[:, None] + np.arange(self.rows)]
            found.append(rows - rows[:, :1])
        return np.asarray(np.concatenate(found)[self.order])
