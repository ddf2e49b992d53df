"""Filters of any frequency response, without delay: derivatives, noise floors, weights by signal to noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import scipy.fft

from rtcomp.kernels import Floats

PAD = 0.1
"""Part of a signal that is mirrored beyond each of its ends before it is filtered."""
BANDS = 60
"""Bands, equally wide in the logarithm of frequency, over which spectra are smoothed."""
AT_A_TIME = 2
"""Signals that are transformed together: more do not stay in the processor's cache."""
ALL = slice(None)

Complexes = npt.NDArray[np.complex128]
Response = Callable[[Floats], Floats]
"""Frequency (Hz) to gain; real, so that nothing is delayed."""


def filtered(
    rows: Floats,
    rate: float,
    response: Response,
    *,
    derivative: bool = False,
    noisy: bool = False,
    wanted: slice = ALL,
) -> Floats:
    """Return signals (p, K) or (K,) filtered by `response`, or the derivative (1/s) of what comes out.

    The signals are mirrored at both ends about the points there, which keeps value and slope; where the last
    point is `noisy`, about its time only: twice its noise would be a step. Of the rows only those `wanted`
    are returned, which is less work where they are few.
    """
    table = np.atleast_2d(rows)
    first, stop, every = wanted.indices(table.shape[1])
    pad = max(2, min(int(PAD * table.shape[1]), table.shape[1] - 1))
    line = _Line(pad, noisy, np.arange(pad + first, pad + stop, every))
    few = -(-(table.shape[1] + 2 * pad) // every)
    few = scipy.fft.next_fast_len(few + few % 2, real=True)
    few += few % 2
    gain = _gain(response, few * every, rate, derivative, pad + first)
    at_rest = float(_gain(response, few * every, rate, False, 0)[0].real)
    out = np.empty((table.shape[0], line.at.size))
    for some in range(0, table.shape[0], AT_A_TIME):
        part = slice(some, some + AT_A_TIME)
        long, level, slope = line.without(table[part], few * every)
        transformed = scipy.fft.rfft(long, axis=1, overwrite_x=True)
        transformed *= gain
        folded = _folded(transformed, every)
        out[part] = scipy.fft.irfft(folded, n=few, axis=1, overwrite_x=True)[:, : line.at.size]
        out[part] += at_rest * (slope * rate if derivative else level + slope * line.at)
    return out if rows.ndim > 1 else out[0]


@dataclass(frozen=True)
class _Line:
    """A straight line has no place in a Fourier series; it is taken away and filtered by itself."""

    pad: int
    noisy: bool
    at: np.ndarray
    """Rows that are wanted, counted from the beginning of what is mirrored."""

    def without(self, table: Floats, count: int) -> tuple[Floats, Floats, Floats]:
        """Return signals (p, count), mirrored and without their line, and its level and slope, (p, 1)."""
        pad, size = self.pad, table.shape[1]
        total = size + 2 * pad
        long = np.zeros((table.shape[0], count))
        long[:, :pad], long[:, pad : pad + size] = table[:, pad:0:-1], table
        long[:, pad + size : total] = table[:, -2 : -pad - 2 : -1]
        if not self.noisy:
            long[:, :pad] = 2.0 * table[:, :1] - long[:, :pad]
            long[:, pad + size : total] = 2.0 * table[:, -1:] - long[:, pad + size : total]
        ends = max(1, pad // 2) if self.noisy else 1
        level, last = long[:, :ends].mean(axis=1), long[:, total - ends : total].mean(axis=1)
        slope = ((last - level) / (total - 1))[:, None]
        long[:, :total] -= level[:, None] + slope * np.arange(total)
        return long, level[:, None], slope


def _folded(transformed: Complexes, every: int) -> Complexes:
    """Return the transform (p, M / 2 + 1) of every so manieth row of real ones, from theirs, (p, N / 2 + 1).

    Taking some of the rows lays the parts of the spectrum, M long each, one over the other.
    """
    if every == 1:
        return transformed
    half = (transformed.shape[1] - 1) // every
    folded = transformed[:, : half + 1].copy()
    for m in range(1, every):
        if 2 * m < every:
            folded += transformed[:, 2 * m * half : (2 * m + 1) * half + 1]
        else:  # beyond the middle: the mirror image
            last = 2 * (every - m) * half
            folded += transformed[:, last - half : last + 1][:, ::-1].conj()
    return np.asarray(folded / every)


@lru_cache(maxsize=64)
def _gain(response: Response, count: int, rate: float, derivative: bool, first: int) -> Complexes:
    """Return a response at the frequencies of a transform of `count` rows, told from row `first` on."""
    frequency: Floats = np.asarray(np.fft.rfftfreq(count, 1.0 / rate), dtype=np.float64)
    gain = np.asarray(response(frequency)) * np.exp(2j * np.pi / rate * first * frequency)
    return np.asarray(gain * (2j * np.pi * frequency if derivative else 1.0))


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
