"""The compared rows of a force balance, as locating, drawing and the next experiment see them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.curves import Curve, curve_of
from rtcomp.diagnosis.locate import axes_of
from rtcomp.diagnosis.second.balance import ForceBalance
from rtcomp.diagnosis.second.data import Segment
from rtcomp.diagnosis.second.fit import Fitted
from rtcomp.diagnosis.second.spectrum import filtered
from rtcomp.kernels import Floats


@dataclass(frozen=True)
class Compared:
    """See `view.View`."""

    balance: ForceBalance

    @property
    def strips(self) -> Sequence[Segment]:
        """The recordings' segments."""
        return self.balance.data.segments

    @property
    def rate(self) -> float:
        """Rows a second (Hz)."""
        return self.balance.data.rate

    @property
    def period(self) -> float:
        """Time between rows (s)."""
        return self.balance.data.period

    @property
    def thinning(self) -> int:
        """Every how manieth row is compared."""
        return self.balance.whitening.thinning

    @property
    def cut(self) -> float:
        """Hz, up to which signal is at least as strong as noise."""
        return min(self.balance.noise.bandwidth, 0.4 * self.rate)

    @property
    def stroke(self) -> tuple[float, float]:
        """Lowest and highest position (m)."""
        return self.balance.data.stroke

    def smooth(self, rows: Sequence[Floats]) -> Floats:
        """Return an array a segment, (K,), below the motion's bandwidth on the compared rows, (n,)."""
        return self.balance.smooth(rows)

    def plain(self, rows: Sequence[Floats]) -> Floats:
        """Return an array a segment, (K,), on the compared rows, (n,)."""
        return self.balance.plain(rows)


def as_force(balance: ForceBalance, residual: Floats) -> Floats:
    """Return a whitened residual (n,) as a force (N): its spectrum coloured again."""
    white = balance.whitening
    rate = balance.data.rate / white.thinning

    def back(frequency: Floats) -> Floats:
        return np.asarray(1.0 / white.white(frequency))

    out, at = [], 0
    for s in balance.data.segments:
        count = s.time[white.rows(s)].size
        out.append(filtered(residual[at : at + count], rate, back, noisy=True))
        at += count
    return np.concatenate(out)


def relative_error(balance: ForceBalance, fitted: Fitted) -> float:
    """Return the force that a fit leaves over that of the drive (rms, N), without the reserved blocks."""
    rows = ~balance.reserved[balance.block]
    left = as_force(balance, fitted.residual)
    power = float(np.mean(balance.drive_force()[rows] ** 2))
    return float(np.sqrt(np.mean(left[rows] ** 2) / max(power, 1e-300)))


def above_noise(balance: ForceBalance, fitted: Fitted) -> float:
    """Return the relative force error (rms) that the sensor's noise does not account for."""
    power = float(np.mean(balance.drive_force() ** 2))
    noise = balance.noise_power / max(power, 1e-300)
    return float(np.sqrt(max(relative_error(balance, fitted) ** 2 - noise, 0.0)))


def curves(balance: ForceBalance, fitted: Fitted) -> list[Curve | None]:
    """Return the curve of each effect of a fit, beside the others: its force along what it follows most."""
    looked = axes_of(Compared(balance), balance.stage.axis)
    rest = as_force(balance, fitted.residual)
    found: list[Curve | None] = []
    for i, entry in enumerate(fitted.entries):
        others = [*fitted.entries[:i], *fitted.entries[i + 1 :]]
        spans = fitted.system.of_entry
        span = spans[len(balance.believed) + i]
        c = np.delete(fitted.coefficients, np.arange(span.start, span.stop))
        without = as_force(balance, balance.error(others, c, fitted.weights))
        force = without - rest
        drawn = np.isfinite(force).all() and bool(np.any(force))
        found.append(curve_of(looked, entry, force, without) if drawn else None)
    return found
