"""Filters of any frequency response, without delay: derivatives, noise floors, weights by signal to noise."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import scipy.fft

from rtcomp.diagnosis.cores import shared
from rtcomp.kernels import Floats, compiled

PAD = 0.1
"""Part of a signal that is mirrored beyond each of its ends before it is filtered."""
BANDS = 60
"""Bands, equally wide in the logarithm of frequency, over which spectra are smoothed."""
WINDOW = 256
"""Rows of the windows that tell white noise: short, so that most have no jump."""
AT_A_TIME = 4
"""Signals that are transformed together: more do not stay in the processor's cache."""
OF_A_POINT = 100.0
"""Floating-point operations of a filter for each point: two transforms, and what is laid out and put back."""
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
    size = table.shape[1]
    first, stop, every = wanted.indices(size)
    pad = max(2, min(int(PAD * size), size - 1))
    at = np.arange(pad + first, pad + stop, every)
    """Rows that are wanted, counted from the beginning of what is mirrored."""
    few = -(-(size + 2 * pad) // every)
    few = scipy.fft.next_fast_len(few + few % 2, real=True)
    few += few % 2
    gain = _gain(response, few * every, rate, derivative, pad + first)
    at_rest = float(_gain(response, few * every, rate, False, 0)[0].real)
    out = np.empty((table.shape[0], at.size))

    def fill(row: int) -> None:
        part = table[row : row + AT_A_TIME]
        long, lines = np.zeros((part.shape[0], few * every)), np.empty((part.shape[0], 2))
        _lay_out(part, pad, noisy, long, lines)
        transformed = scipy.fft.rfft(long, axis=1, overwrite_x=True)
        folded = np.zeros((part.shape[0], few // 2 + 1), np.complex128)
        _fold(transformed, gain, every, folded)
        found = scipy.fft.irfft(folded, n=few, axis=1, overwrite_x=True)
        _put_back(found, lines, at_rest, rate, derivative, at, out[row : row + AT_A_TIME])

    work = OF_A_POINT * table.shape[0] * few * every
    shared(fill, range(0, table.shape[0], AT_A_TIME), operations=work)
    return out if rows.ndim > 1 else out[0]


@compiled
def _lay_out(table: Floats, pad: int, noisy: bool, long: Floats, lines: Floats) -> None:
    """Put signals (p, K) into `long` (p, N), mirrored over `pad` rows and without a straight line.

    A straight line has no place in a Fourier series; its level and slope a row go to `lines`, (p, 2), and it
    is filtered by itself.
    """
    size = table.shape[1]
    total = size + 2 * pad
    ends = max(1, pad // 2) if noisy else 1
    for i in range(table.shape[0]):
        x, y = table[i], long[i]
        for k in range(size):
            y[pad + k] = x[k]
        for k in range(pad):
            y[k], y[pad + size + k] = x[pad - k], x[size - 2 - k]
        if not noisy:
            for k in range(pad):
                y[k], y[pad + size + k] = 2.0 * x[0] - y[k], 2.0 * x[size - 1] - y[pad + size + k]
        level, slope = y[:ends].mean(), y[total - ends : total].mean()
        slope = (slope - level) / (total - 1)
        for k in range(total):
            y[k] -= level + slope * k
        lines[i, 0], lines[i, 1] = level, slope


@compiled
def _fold(transformed: Complexes, gain: Complexes, every: int, folded: Complexes) -> None:
    """Put the transforms (p, M / 2 + 1) of every so manieth row into `folded`: those of all, times `gain`.

    Taking some of the rows lays the parts of the spectrum, M long each, one over the other.
    """
    half = folded.shape[1] - 1
    for i in range(transformed.shape[0]):
        x, y = transformed[i], folded[i]
        for m in range(every):
            if 2 * m < every:
                at = 2 * m * half
                for k in range(half + 1):
                    y[k] += gain[at + k] * x[at + k]
            else:  # beyond the middle: the mirror image
                at = 2 * (every - m) * half
                for k in range(half + 1):
                    y[k] += (gain[at - k] * x[at - k]).conjugate()
        for k in range(half + 1):
            y[k] /= every


@compiled
def _put_back(
    found: Floats, lines: Floats, at_rest: float, rate: float, derivative: bool, at: np.ndarray, out: Floats
) -> None:
    """Put what was `found` and its line, as it passes at a response of `at_rest`, into `out`."""
    for i in range(out.shape[0]):
        level, slope = at_rest * lines[i, 0], at_rest * lines[i, 1]
        for k in range(out.shape[1]):
            out[i, k] = found[i, k] + (slope * rate if derivative else level + slope * at[k])


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


def motion_spectrum(positions: list[Floats], rate: float) -> tuple[Floats, Floats]:
    """Return frequencies (Hz) and the power density (m^2/Hz) of positions (m, (K,) each), as `spectrum` does.

    By their second differences, whose density is as many times that of position at every frequency. A stroke
    may be ten million times the sensor's noise, and what leaks of it past a window would pass for motion.
    """
    frequency, density = spectrum([np.diff(x, 2) for x in positions], rate)
    return frequency, density / (2.0 * np.sin(np.pi * frequency / rate)) ** 4


def white_noise(positions: list[Floats]) -> float:
    """Return the rms of white noise in positions, (K,) each; 0 where motion hides it, or all are short.

    Noise is as dense in the highest octave as in the one below. Motion falls with frequency, at the least as
    a step does: what the lower octave has more is taken away so. The median over short windows passes over
    what is not always there, as a jump.
    """
    curved = [np.diff(x, 2) for x in positions]
    windows = np.concatenate([c[: c.size // WINDOW * WINDOW].reshape(-1, WINDOW) for c in curved])
    if not windows.size:
        return 0.0
    shape = np.hanning(WINDOW + 2)[1:-1]
    windows = (windows - windows.mean(axis=1, keepdims=True)) * shape
    curvature = (2.0 * np.sin(np.pi * np.arange(WINDOW // 2 + 1) / WINDOW)) ** 2
    lower, upper = (slice(WINDOW // k + 1, 2 * WINDOW // k + 1) for k in (8, 4))
    power = np.abs(scipy.fft.rfft(windows, axis=1)) ** 2 / (shape @ shape)
    below, above = (np.mean(power[:, some] / curvature[some] ** 2, axis=1) for some in (lower, upper))
    falls = float(np.mean(1.0 / curvature[lower]) / np.mean(1.0 / curvature[upper]))
    white = (falls * above - below) / (falls - 1.0)
    return float(np.sqrt(max(np.median(white), 0.0)))


def interpolated(frequency: Floats, density: Floats) -> Response:
    """Return a response through positive `density` (F,) at `frequency` (Hz), on logarithmic axes."""
    known, level = np.log(frequency), np.log(np.maximum(density, 1e-300))

    def response(at: Floats) -> Floats:
        return np.asarray(np.exp(np.interp(np.log(np.maximum(at, frequency[0])), known, level)))

    return response
