"""How much of a residual is a wave along the position, for many periods at once."""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats

BINS = 8192
FINE = 5
"""Waves tried for each whole number of them in the span."""


def periodogram(
    x: Floats, span: float, weight: Floats, residual: Floats, most: float
) -> tuple[Floats, Floats]:
    """Return numbers of waves in `span` (m), and how much squared `residual` each explains alone (N^2).

    Waves are sines and cosines of position `x` (m, (K,)) times `weight` (K,); their numbers go up in fifths
    to `most`. Positions are shared out to bins, so that all of it is a few Fourier transforms.
    """
    at = (x - x.min()) / span * BINS
    low = np.floor(at).astype(np.int64)
    part = at - low

    def spectrum(values: Floats) -> np.ndarray:
        bins = np.bincount(low, values * (1.0 - part), BINS + 2)
        bins += np.bincount(low + 1, values * part, BINS + 2)
        return np.asarray(np.fft.rfft(bins, FINE * BINS))

    count = min(int(most * FINE), BINS)
    k = np.arange(1, count + 1)
    projected, squared = spectrum(weight * residual)[k], spectrum(weight**2)
    # Of the squared waves: half the weight's square, more or less what it has at twice the number.
    half, double = 0.5 * squared[0].real, 0.5 * squared[2 * k].real
    least = 1e-9 * half + 1e-300
    power = projected.real**2 / np.maximum(half + double, least)
    power += projected.imag**2 / np.maximum(half - double, least)
    return k / FINE, power
