"""How much of a residual is a wave along the position, for many periods at once; peaks, in time too."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rtcomp.kernels import Floats

BINS = 8192
BESIDE = 3
"""Numbers of waves, in steps of the periodogram, on either side of a peak that belong to it."""
FINE = 5
"""Waves tried for each whole number of them in the span."""


class Bins:
    """Positions `x` (K,) within `span` (m), shared out to bins: waves along them are Fourier lines."""

    def __init__(self, x: Floats, span: float) -> None:
        at = (x - x.min()) / span * BINS
        self._low = np.floor(at).astype(np.int64)
        self._part = at - self._low

    def lines(self, values: Floats) -> npt.NDArray[np.complex128]:
        """Return the sums of `values` (K,) times exp(-2 pi i n x / span) for n = 0, 1 / FINE, 2 / FINE ..."""
        bins = np.bincount(self._low, values * (1.0 - self._part), BINS + 2)
        bins += np.bincount(self._low + 1, values * self._part, BINS + 2)
        return np.fft.rfft(bins, FINE * BINS)


def periodogram(
    x: Floats, span: float, weight: Floats, residual: Floats, most: float
) -> tuple[Floats, Floats]:
    """Return numbers of waves in `span` (m), and how much squared `residual` each explains alone (N^2).

    Waves are sines and cosines of position `x` (m, (K,)) times `weight` (K,); their numbers go up in fifths
    to `most`.
    """
    bins = Bins(x, span)
    count = min(int(most * FINE), BINS)
    k = np.arange(1, count + 1)
    projected, squared = bins.lines(weight * residual)[k], bins.lines(weight**2)
    # Of the squared waves: half the weight's square, more or less what it has at twice the number.
    half, double = 0.5 * squared[0].real, 0.5 * squared[2 * k].real
    least = 1e-9 * half + 1e-300
    power = projected.real**2 / np.maximum(half + double, least)
    power += projected.imag**2 / np.maximum(half - double, least)
    return k / FINE, power


def highest(n: Floats, power: Floats, peaks: int, same: float = 0.0) -> list[float]:
    """Return the numbers of waves `n` of the highest `power`, none beside another or within `same` of it."""
    left, found = power.copy(), []
    for _ in range(peaks):
        at = int(np.argmax(left))
        found.append(float(n[at]))
        left[max(at - BESIDE, 0) : at + BESIDE + 1] = 0.0
        left[np.abs(np.log(n / n[at])) < same] = 0.0
    return found


def peak_near(frequency: float, step: float, time: Floats, values: Floats) -> float:
    """Return the frequency (Hz), within a `step`, of which `values` (K,) at `time` (s, (K,)) have most.

    Between the frequencies of a transform a line over a long time is weaker than its neighbours of a gap.
    """
    from scipy.optimize import minimize_scalar

    def power(at: float) -> float:
        return -float(abs(np.exp(-2j * np.pi * at * time) @ values))

    near = (frequency - step, frequency + step)
    return float(minimize_scalar(power, bounds=near, method="bounded", options={"xatol": 1e-2 * step}).x)
