"""The compared rows of a force balance, as locating, drawing and the next experiment see them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.mismatch.curves import Curve, curve_of
from rtcomp.diagnosis.mismatch.locate import axes_of
from rtcomp.diagnosis.numerics.spectrum import Response, filtered, interpolated, spectrum
from rtcomp.diagnosis.recordings.data import Segment
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

ROUNDING = 1e-9
"""Part of the force up to which what an effect does is nothing."""
NARROW = 5
"""Bands of a spectrum, of which a line has fewer: what has as many is no line."""


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
    white = balance.weighed(residual[None].copy(), back=True)[0]
    return _weighed(balance, white, balance.whitening.coloured)


def as_white(balance: ForceBalance, force: Floats) -> Floats:
    """Return a force (N, (n,)) on the compared rows as a whitened residual: the inverse of `as_force`."""
    return np.asarray(balance.weighed(_weighed(balance, force, balance.whitening.white)[None])[0])


def as_seen(balance: ForceBalance, force: Floats, first: Floats | None = None) -> Floats:
    """Return what of a force (N, (n,)) on the compared rows stands above the sensor's noise.

    At each frequency as far as the drive's force does, or as a line of that force does, above what is beside
    it as well: a tone need not be among what the drive does. What is compared counts alike: by the lines of
    the `first` force of several.
    """
    from scipy.ndimage import grey_opening

    frequency, share, noise = _seen(balance)
    lines = list(_by_segment(balance, force if first is None else first))
    own, density = spectrum(lines, balance.data.rate / balance.whitening.thinning)
    louder = density / np.maximum(np.interp(own, frequency, noise) * balance.noise.wiener(own) ** 2, 1e-300)
    line = np.pad(_above(np.maximum(grey_opening(louder, (NARROW,)), 1.0), louder), 1)
    line = np.max([line[:-2], line[1:-1], line[2:]], axis=0)  # it may lie at the edge of its band
    both = np.union1d(frequency, own)
    most = np.maximum(np.interp(both, frequency, share), np.interp(both, own, line))
    return _weighed(balance, force, interpolated(both, np.maximum(most, 1e-6)))


def left_seen(balance: ForceBalance, *stages: Stage) -> list[Floats]:
    """Return the force (N, (n,)) that each of `stages` leaves open, as far as it is seen, all alike."""
    left = [drive - needed for drive, needed in map(balance.both_sides, stages)]
    return [as_seen(balance, each, left[0]) for each in left]


def noise_seen(balance: ForceBalance) -> float:
    """Return what the sensor's noise makes of the force that `as_seen` leaves (N rms)."""
    frequency, share, noise = _seen(balance)
    density = noise * (share * balance.noise.wiener(frequency)) ** 2
    return float(np.sqrt(np.trapezoid(density, frequency)))


def _seen(balance: ForceBalance) -> tuple[Floats, Floats, Floats]:
    """Return frequencies (Hz), the part of the drive's force that is no noise, and that noise (N^2/Hz)."""
    frequency, density, noise = balance.force_densities()
    return frequency, _above(noise, density), noise


def _above(noise: Floats, density: Floats) -> Floats:
    """Return the part of a density that is no noise."""
    return np.maximum(1.0 - noise / np.maximum(density, 1e-300), 0.0)


def _by_segment(balance: ForceBalance, signal: Floats) -> Iterator[Floats]:
    """Yield the compared rows (n,) of each segment."""
    at = 0
    for s in balance.data.segments:
        count = s.time[balance.whitening.rows(s)].size
        yield signal[at : at + count]
        at += count


def _weighed(balance: ForceBalance, signal: Floats, response: Response) -> Floats:
    rate = balance.data.rate / balance.whitening.thinning
    return np.concatenate([filtered(s, rate, response, noisy=True) for s in _by_segment(balance, signal)])


def curves(
    balance: ForceBalance, entries: Sequence[Entry], rest: Floats, without: Sequence[Floats]
) -> list[Curve | None]:
    """Return the curve of each of `entries`, beside the others: its force along what it follows most.

    `rest` (N, (n,)) is the force that all leave open, `without` that of all but each.
    """
    looked = axes_of(Compared(balance), balance.stage.axis)
    found: list[Curve | None] = []
    for entry, open_force in zip(entries, without, strict=True):
        force = open_force - rest
        least = ROUNDING * float(np.abs(open_force).max(initial=0.0))
        drawn = np.isfinite(force).all() and bool(np.abs(force).max(initial=0.0) > least)
        found.append(curve_of(looked, entry, force, open_force) if drawn else None)
    return found
