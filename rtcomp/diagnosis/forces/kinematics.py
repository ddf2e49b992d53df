"""The motion of a recording: position, velocity, acceleration, and what they see of the drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.recordings.data import Data, Segment
from rtcomp.kernels import Floats
from rtcomp.stage.balance import Forces, around_rows


@dataclass(frozen=True)
class Path:
    """The motion behind a segment, all (K,): true position smoothed (m), velocity, acceleration of both."""

    x: Floats
    v: Floats
    a: Floats
    measured: Floats
    """Acceleration (m/s^2) of the position as measured, as the balance compares it."""

    def part(self, rows: slice) -> Path:
        """Return some of its rows."""
        return Path(self.x[rows], self.v[rows], self.a[rows], self.measured[rows])


def second_difference(x: Floats, rate: float) -> Floats:
    """Return the accelerations (m/s^2) of a position (m, (K,)) at `rate` (Hz): nothing at both ends."""
    a = np.zeros_like(x)
    a[1:-1] = (x[2:] - 2.0 * x[1:-1] + x[:-2]) * rate**2
    return a


def acted(f: Forces, segment: Segment, data: Data, force_constant: float) -> Floats:
    """Return the force (N, (K,)) of a drive around the rows of a segment, as and when its command acted.

    Second differences weigh it by a triangle from the row before to the row after. Of a command u held from
    row to row that is (u[k-1] + u[k]) / 2; where it acts a part e of a row early, e (u[k] - u[k-1]) and
    e^2 (u[k+1] - 2 u[k] + u[k-1]) / 2 more.
    """
    if not data.held:
        return around_rows(f.drive)
    force = f.held_drive()
    changed = 2.0 * force - 4.0 * f.drive_rising
    if segment.finer is not None:
        force = force + force_constant * segment.finer
    if data.early:
        force = force + data.early * (changed + 0.5 * data.early * np.diff(changed, append=changed[-1:]))
    return force
