"""What a recording offers to each unit: start values of the parameters of any effect.

A length goes from the sensor's grain to the stroke, a speed over those of the motion, a voltage over those of
the command, a time from a row to the last of the recording, a frequency to the motion's bandwidth; periods
and tones of waves come from periodograms of the residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.fft

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.periodogram import highest, peak_near, periodogram
from rtcomp.kernels import Floats
from rtcomp.physics import Effect, Parameter

POINTS = 5
"""Start values of a nonlinear parameter."""
PEAKS = 3
"""Peaks taken of a periodogram."""
ONE_WAVE = 0.02
"""Difference of the logarithm of periods that are found for one wave."""
APART = 2.0
"""Ratio of neighbouring voltages at most: a fit finds its way from one to the next."""


@dataclass(frozen=True)
class Scales:
    """What a recording offers to each unit."""

    balance: ForceBalance
    residual: tuple[Floats, Floats]
    """Of the fit beside which to look, (n,) each: as a force (N), and whitened, without the reserved."""
    length: tuple[float, float]
    stroke: tuple[float, float]
    speed: Floats
    volts: Floats
    time: tuple[float, float]
    frequency: tuple[float, float]
    force: float

    @cached_property
    def periods(self) -> Floats:
        """Periods (m) of waves along the position in the residual."""
        return _periods(self.balance, *self.residual)

    @cached_property
    def tones(self) -> Floats:
        """Frequencies (Hz) of the strongest lines of the residual in time."""
        return tones_of(self.balance, self.residual[1])

    @cached_property
    def moments(self) -> Floats:
        """Times (s) at which something may have happened."""
        return _moments(self.balance, self.residual[1])

    @classmethod
    def of(cls, fitter: Fitter, fitted: Fitted) -> Scales:
        """Measure them on the compared rows and on the residual of a fit."""
        balance = fitter.balance
        data, paths = balance.data, balance.paths()
        v = np.abs(balance.plain([p.v for p in paths]))
        u = np.abs(balance.plain([s.voltage for s in data.segments]))
        low, high = data.stroke
        # What cuts a command may show in the highest of it only.
        quantiles = np.concatenate([np.linspace(0.1, 0.9, POINTS), 1.0 - np.geomspace(0.03, 0.001, 3)])
        moving = v[v > 1e-3 * v.max()] if v.max() > 0 else v
        slow, fast = (max(float(np.quantile(moving, q)), 1e-12) for q in (0.02, 0.9))
        speed = np.geomspace(slow, fast, POINTS)
        used = ~balance.reserved[balance.block]
        force, white = fitter.force(fitted) * used, fitter.whitened(fitted) * used
        return cls(
            balance,
            (force, white),
            (max(2.0 * balance.grain, 1e-5 * (high - low)), 0.5 * (high - low)),
            (low, high),
            speed,
            _filled(np.unique(np.quantile(u[u > 0], quantiles))) if np.any(u > 0) else np.ones(1),
            (data.period, data.last),
            (4.0 / data.last, min(0.4 * data.rate, balance.noise.bandwidth)),
            float(np.sqrt(np.mean(force**2))),
        )

    def of_parameter(self, p: Parameter, kind: type[Effect]) -> Sequence[float]:
        """Return the start values of a nonlinear parameter, within its bounds."""
        found = self._of_parameter(p, kind)
        return [float(x) for x in found if p.lowest <= x <= p.high and not (p.open_low and x == p.low)]

    def _of_parameter(self, p: Parameter, kind: type[Effect]) -> list[float]:
        waves = any(q.unit == ent.PHASE for q in kind.parameters)
        if p.name in kind.search_grid:
            return list(kind.search_grid[p.name])
        if p.choice:
            return [p.low, p.high]
        if p.name == ent.PERIOD:
            return _listed(self.periods)
        if p.name == ent.MOMENT:
            return _listed(self.moments)
        if p.unit == "Hz" and waves:
            return _listed(self.tones)
        if p.unit == "m" and p.low < 0.0:
            return _listed(np.linspace(*self.stroke, 2 * POINTS + 3)[1:-1])
        found = self._of_unit(p.unit.removeprefix("1/"))
        if found is not None:
            return [1.0 / value for value in found] if p.unit.startswith("1/") else found
        return [float(kind.example.get(p.name, 1.0))]

    def _of_unit(self, unit: str) -> list[float] | None:
        """Return the values that a unit takes on this recording, None of a unit without scale."""
        found = {
            "m": np.geomspace(*self.length, POINTS + 1),
            "m/s": self.speed,
            "V": self.volts,
            "N": self.force * np.array([0.3, 1.0, 3.0]),
            "s": np.geomspace(*self.time, POINTS + 2)[1:],
            "Hz": np.geomspace(*self.frequency, 8 * POINTS),
        }.get(unit)
        return None if found is None else _listed(found)


def _filled(values: Floats) -> Floats:
    """Return sorted positive values, and between those that are far apart as many more as it takes.

    What a loop commands once, far above all else, leaves a gap between quantiles.
    """
    steps = np.ceil(np.log(values[1:] / values[:-1]) / np.log(APART)).astype(int)
    between = [np.geomspace(a, b, n + 1)[1:-1] for a, b, n in zip(values, values[1:], steps, strict=False)]
    return np.sort(np.concatenate([values, *between]))


def _listed(values: Floats) -> list[float]:
    return [float(value) for value in values]


def _periods(balance: ForceBalance, force: Floats, residual: Floats) -> Floats:
    """Return periods (m) of waves along the position, in the residual as force and as displacement.

    A wave of the force, of friction, of the drive, and of the reading, whose acceleration goes by the square
    of the speed. Of periods that are alike, that which explains most: the others are off by their weight.
    """
    paths = balance.paths()
    x = balance.plain([p.x for p in paths])
    v = balance.plain([p.v for p in paths])
    u = balance.plain([s.voltage for s in balance.data.segments])
    span = float(np.ptp(x))
    step = float(np.median(np.abs(np.diff(x)))) or span / 1000.0
    most = float(np.clip(span / max(2.0 * step, 4.0 * balance.grain, 1e-4 * span), 4.0, 1500.0))
    found: list[tuple[float, float]] = []
    for weight, of in (
        (np.ones_like(x), force),
        (np.sign(v), force),
        (u, force),
        (v**2, force),
        (np.ones_like(x), residual),
    ):
        n, power = periodogram(x, span, weight, of, most)
        n, share = n[n >= 0.8], power[n >= 0.8] / max(float(of @ of), 1e-300)
        found += [(float(share[n == k][0]), span / k) for k in highest(n, share, PEAKS, 0.05)]
    periods: list[float] = []
    for _, period in sorted(found, reverse=True):
        if all(abs(np.log(period / other)) > ONE_WAVE for other in periods):
            periods.append(period)
    return np.sort(periods)


def tones_of(balance: ForceBalance, residual: Floats) -> Floats:
    """Return frequencies (Hz) of the strongest lines of the residual in time.

    A tone goes on between segments: each stands at its own time, and what is between them is nothing.
    """
    rate, segments = balance.data.rate, balance.data.segments
    times = [s.time[balance.whitening.rows(s)] for s in segments]
    at = np.round((np.concatenate(times) - min(t[0] for t in times)) * rate).astype(np.int64)
    faded = residual * np.concatenate([np.hanning(t.size) for t in times])
    line = np.bincount(at, faded)
    count = scipy.fft.next_fast_len(2 * line.size, real=True)
    power = np.abs(scipy.fft.rfft(line, count)) ** 2
    frequency = np.asarray(np.arange(power.size) * (rate / count), dtype=np.float64)
    slow, fast = rate / line.size, rate / balance.whitening.thinning
    some = (frequency > 3.0 * slow) & (frequency < 0.45 * fast)
    lines: list[float] = highest(frequency[some], np.asarray(power[some], dtype=np.float64), PEAKS + 2, 0.01)
    return np.sort([peak_near(one, rate / count, at / rate, faded) for one in lines])


def _moments(balance: ForceBalance, residual: Floats) -> Floats:
    """Return times (s) at which the reading steps, and those of the largest residuals, apart from each other.

    A step stands between two rows of the recording, a residual within what the filter remembers of it.
    """
    time = balance.plain([s.time for s in balance.data.segments])
    stepped = [j.time for j in balance.data.jumps]
    left, found = np.abs(residual), []
    apart = max(10, residual.size // 500)
    for _ in range(PEAKS):
        at = int(np.argmax(left))
        found.append(float(time[at]))
        left = left.copy()
        left[max(at - apart, 0) : at + apart + 1] = 0.0
    return np.sort([*stepped, *found])
