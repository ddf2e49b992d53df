"""The motion of a recording: position, velocity, acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.kernels import Floats


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
