"""Filters of any frequency response, without delay: derivatives, noise floors, weights by signal to noise."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import scipy.fft

from rtcomp.kernels import Floats

PAD = 0.1
"""Part of a signal that is mirrored beyond each of its ends before it is filtered."""
BANDS = 60
"""Bands, equally wide in the logarithm of frequency, over which spectra are smoothed."""

Response = Callable[[Floats], Floats]
"""Frequency (Hz) to gain; real, so that nothing is delayed."""


def filtered(
    rows: Floats, rate: float, response: Response, *, derivative: bool = False, noisy: bool = False
) -> Floats:
    """Return signals (p, K) or (K,) filtered by `response`, or the derivative (1/s) of what comes out.

    The signals are mirrored at both ends about the points there, which keeps value and slope; where the last
    point is `noisy`, about its time only: twice its noise would be a step.
    """
    table = np.atleast_2d(rows)
    size = table.shape[1]
    pad = max(2, min(int(PAD * size), size - 1))
    total = size + 2 * pad
    count = scipy.fft.next_fast_len(total, real=True)
    long = np.zeros((table.shape[0], count))
    long[:, :pad], long[:, pad : pad + size] = table[:, pad:0:-1], table
    long[:, pad + size : total] = table[:, -2 : -pad - 2 : -1]
    if not noisy:
        long[:, :pad] = 2.0 * table[:, :1] - long[:, :pad]
        long[:, pad + size : total] = 2.0 * table[:, -1:] - long[:, pad + size : total]
    # A straight line has no place in a Fourier series; it is filtered by itself.
    ends = max(1, pad // 2) if noisy else 1
    level, last = long[:, :ends].mean(axis=1), long[:, total - ends : total].mean(axis=1)
    slope = ((last - level) / (total - 1))[:, None]
    line = level[:, None] + slope * np.arange(total)
    long[:, :total] -= line
    transformed = scipy.fft.rfft(long, axis=1, overwrite_x=True)
    gain = _gain(response, count, rate, derivative)
    at_rest = float(_gain(response, count, rate, False)[0])
    transformed *= gain
    out = scipy.fft.irfft(transformed, n=count, axis=1, overwrite_x=True)[:, pad : pad + size]
    out += at_rest * (slope * rate if derivative else line[:, pad : pad + size])
    return np.asarray(out.reshape(rows.shape))


@lru_cache(maxsize=64)
def _gain(response: Response, count: int, rate: float, derivative: bool) -> np.ndarray:
    """Return a response at the frequencies of a transform of `count` rows."""
    frequency: Floats = np.asarray(np.fft.rfftfreq(count, 1.0 / rate), dtype=np.float64)
    gain = np.asarray(response(frequency))
    return gain * (2j * np.pi * frequency) if derivative else gain


def spectrum(rows: list[Floats], rate: float) -> tuple[Floats, Floats]:
    """Return frequencies (Hz, (F,)) and the one-sided power density (unit^2/Hz) of signals, (K,) each.

    Welch's method (1967) with a window whose leakage stays 92 dB down (Harris 1978, Proc. IEEE 66(1)), so
    that weak high frequencies stand beside strong low ones; smoothed over bands.
    """
    length = min(4096, *(r.size for r in rows))
    angle = 2.0 * np.pi * np.arange(length) / length
    window = 0.35875 - 0.48829 * np.cos(angle) + 0.14128 * np.cos(2.0 * angle) - 0.01168 * np.cos(3.0 * angle)
    line = np.linspace(-1.0, 1.0, length)
    total, weight = np.zeros(length // 2 + 1), 0
    for r in rows:
        for start in range(0, r.size - length + 1, max(length // 2, 1)):
            part = r[start : start + length] - r[start : start + length].mean()
            part = (part - line * (part @ line) / (line @ line)) * window
            total += np.abs(scipy.fft.rfft(part)) ** 2
            weight += 1
    total *= 2.0 / (rate * float(window @ window) * weight)
    frequency = np.arange(total.size) * (rate / length)
    edges = np.unique(np.round(np.geomspace(1, frequency.size, BANDS)).astype(np.int64))
    starts = edges[:-1]
    widths = np.diff(edges)
    density = np.add.reduceat(total[: edges[-1]], starts) / widths
    centre = np.add.reduceat(frequency[: edges[-1]], starts) / widths
    return centre, density


def interpolated(frequency: Floats, density: Floats) -> Response:
    """Return a response through positive `density` (F,) at `frequency` (Hz), on logarithmic axes."""
    known, level = np.log(frequency), np.log(np.maximum(density, 1e-300))

    def response(at: Floats) -> Floats:
        return np.asarray(np.exp(np.interp(np.log(np.maximum(at, frequency[0])), known, level)))

    return response
