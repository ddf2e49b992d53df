"""A wave along the stroke: the one period in position that most of the residual force follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.numerics.periodogram import FINE, Bins
from rtcomp.kernels import Floats
from rtcomp.units import prefixed

FINEST = 512
"""Periods in the stroke, at the most."""
COARSEST = 2.5
"""Periods in the stroke, at the least: below, it is a slope or a bend."""
STEADY = 0.4
"""Part of its amplitude that a wave has in either half of the rows along the stroke."""


@dataclass(frozen=True)
class Wave:
    """The strongest wave: its period (m), whether it changes sign with the motion, and how sure it is."""

    period: float
    odd: bool
    share: float
    """Part of the residual (squared) that a sine of this period is."""
    p_value: float
    slow: float
    fast: float
    """Its amplitude (N) at the slower and the faster half of the speeds."""

    def says(self, unit: str) -> str:
        """Return it in words, the period in `unit` (m or rad)."""
        way = "with the sign of the motion" if self.odd else "both directions alike"
        weak, strong = sorted((abs(self.slow), abs(self.fast)))
        if weak > 0.6 * strong:
            speeds = "all speeds"
        else:
            speeds = f"mostly {'slow' if abs(self.slow) > abs(self.fast) else 'fast'} motion"
        (period,), unit = prefixed(unit, self.period)
        return (
            f"{100 * self.share:.0f} % of the mismatch is periodic in position: period {period} {unit}, "
            f"{way}, {speeds}"
        )


def wave(x: Floats, direction: Floats, speed: Floats, residual: Floats, shifts: np.ndarray) -> Wave | None:
    """Return the wave along `x` (m) that most of `residual` (N) follows; all (n,), `direction` -1, 0 or 1.

    Its significance is that of the strongest wave of all after the residual was shifted in a circle by each
    of `shifts` rows. None where the stroke is nothing, or no wave goes all along it.
    """
    span = float(np.ptp(x))
    if not span > 0.0:
        return None
    bins = Bins(x, span)
    power = max(float(residual @ residual), 1e-300)
    first = int(np.ceil(COARSEST * FINE))

    def spectrum(signed: Floats) -> Floats:
        lines = bins.lines(signed)[first : FINE * FINEST]
        return np.asarray(2.0 * np.abs(lines) ** 2 / (x.size * power))

    even, odd = spectrum(residual), spectrum(residual * direction)
    is_odd = bool(odd.max() > even.max())
    chosen = odd if is_odd else even
    null = np.array([spectrum(np.roll(residual, k)).max() for k in shifts])
    p = (1.0 + float(np.count_nonzero(null >= chosen.max()))) / (null.size + 1.0)
    # Rows are not spread evenly over the stroke: the share is that of a fit, and the period refined by it.
    signed = residual * direction if is_odd else residual
    count = (first + int(np.argmax(chosen))) / FINE
    trials = [_fitted(x, signed, span / c) for c in count + np.linspace(-0.5, 0.5, 41) / FINE * 2]
    explained, period, coefficients = max(trials)
    angle = 2 * np.pi * x / period
    basis = coefficients[0] * np.cos(angle) + coefficients[1] * np.sin(angle)
    size = float(np.hypot(*coefficients))

    def among(rows: np.ndarray) -> float:
        return size * float(signed[rows] @ basis[rows]) / max(float(basis[rows] @ basis[rows]), 1e-300)

    left = x <= np.median(x)
    if min(among(left), among(~left)) < STEADY * size:
        return None  # a bump here and there, not a wave
    slow = np.abs(speed) <= np.median(np.abs(speed))
    return Wave(period, is_odd, min(explained / power, 1.0), p, among(slow), among(~slow))


def _fitted(x: Floats, y: Floats, period: float) -> tuple[float, float, tuple[float, float]]:
    """Return what a sine of this period explains of `y` (squared), the period, and its coefficients."""
    c, s = np.cos(2 * np.pi * x / period), np.sin(2 * np.pi * x / period)
    gram = np.array([[c @ c, c @ s], [c @ s, s @ s]]) + 1e-9 * x.size * np.eye(2)
    cross = np.array([c @ y, s @ y])
    found = np.linalg.solve(gram, cross)
    return float(found @ cross), period, (float(found[0]), float(found[1]))
