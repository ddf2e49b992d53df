"""Even sampling: is it, and if not, make it so."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rtcomp.recording.pieces import Floats, pieces, sample, steps

JITTER = 0.1
"""Deviation from the even grid, in periods, up to which samples count as evenly spaced."""
GAP = 1.75
"""An interval longer than this times the usual longest one (95th percentile) is a gap."""
SMOOTH = ("position", "reference", "velocity")
"""Columns of continuous motion, interpolated by a monotone cubic; all others go in straight lines."""
MEASURED = (*SMOOTH, "voltage", "current", "force")
"""Columns that have values in between even where all are whole numbers (encoder counts, duty cycles)."""
METHODS = ("cubic", "linear")


@dataclass(frozen=True)
class Sampling:
    """How a recording was sampled."""

    rate_hz: float
    """Rows a second of the even grid through the first and last row, or the median rate where uneven."""
    jitter: float
    """Largest deviation from that even grid, in periods."""
    gaps: npt.NDArray[np.int64]
    """Rows after which a gap follows."""

    @property
    def even(self) -> bool:
        """Whether the rows are equally spaced but for tolerable jitter."""
        return self.jitter <= JITTER and not len(self.gaps)


def examine(time: Floats) -> Sampling:
    """Return how `time` (s, increasing, at least two rows) is sampled."""
    intervals = np.concatenate([np.diff(part) for part in sample(time)])
    usual = float(np.quantile(intervals, 0.95))
    gaps = np.concatenate([first + np.flatnonzero(step > GAP * usual) for first, step in steps(time)])
    period = float(time[-1] - time[0]) / (len(time) - 1)
    deviation = max(
        float(np.max(np.abs(time[part] - time[0] - period * np.arange(part.start, part.stop))))
        for part in pieces(len(time))
    )
    deviation /= period
    if deviation > JITTER or len(gaps):
        period = float(np.median(intervals))
    return Sampling(_round(1.0 / period), deviation, gaps)


def _round(rate: float) -> float:
    """Return `rate`, or the round number that it is but for the rounding of time stamps."""
    near = round(rate, 1) if rate >= 10 else round(rate, 3)
    return near if near and abs(rate / near - 1.0) < 1e-6 else float(f"{rate:.12g}")


def resample(
    columns: dict[str, Floats], rate_hz: float, sampling: Sampling, method: str = "cubic"
) -> dict[str, Floats]:
    """Return `columns` (1-D, among them `time`, s) on an even grid of `rate_hz` that begins at the first row.

    `method` ``cubic`` interpolates motion (SMOOTH) by a monotone cubic (Fritsch and Carlson 1980, SIAM J.
    Numer. Anal. 17:238), which cannot ring beside an outlier or a step, and everything else linearly;
    ``linear`` takes straight lines throughout. Flags and counters (whole numbers, not MEASURED) hold their
    last value. Where `rate_hz` is well below the rate of the rows, all but those are low-pass filtered
    alike, without phase, below the new Nyquist frequency (on a finer grid, then decimated): what could not
    be represented must not fold back.
    """
    time = columns["time"]
    down = int(np.ceil(sampling.rate_hz / rate_hz)) if rate_hz < 0.95 * sampling.rate_hz else 1
    rows = int(np.floor((time[-1] - time[0]) * rate_hz + 1e-6)) + 1
    fine = time[0] + np.arange((rows - 1) * down + 1) / (rate_hz * down)
    even: dict[str, Floats] = {}
    for name, column in columns.items():
        if name == "time":
            even[name] = fine[::down].copy()
        elif name not in MEASURED and _held(column):
            at = np.searchsorted(time, fine[::down] + 1e-9 / rate_hz, side="right") - 1
            even[name] = column[np.maximum(at, 0)]
        else:
            even[name] = _decimate(_interpolate(time, column, fine, method, name), down)[:rows]
    return even


def _interpolate(time: Floats, column: Floats, grid: Floats, method: str, name: str) -> Floats:
    if method == "cubic" and name in SMOOTH and np.all(np.isfinite(column)):
        from scipy.interpolate import PchipInterpolator

        out = np.empty_like(grid)
        for part in pieces(len(grid)):
            # The slopes at a row are made of it and its neighbours: a piece needs two more on either side.
            begin = max(int(np.searchsorted(time, grid[part.start])) - 3, 0)
            end = int(np.searchsorted(time, grid[part.stop - 1])) + 4
            near = PchipInterpolator(time[begin:end], column[begin:end])
            out[part] = near(np.minimum(grid[part], time[-1]))
        return out
    return np.interp(grid, time, column)


def _decimate(signal: Floats, down: int) -> Floats:
    if down == 1:
        return signal
    from scipy.signal import resample_poly

    return np.asarray(resample_poly(signal, 1, down, padtype="line"))


def _held(column: Floats) -> bool:
    """Return whether `column` holds flags or a counter, which have no values in between."""
    return bool(np.all(np.isfinite(column)) and np.all(column == np.round(column)))


def in_gap(grid: Floats, time: Floats, gaps: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Return which times of `grid` lie strictly inside a gap of `time`, where nothing was measured."""
    inside = np.zeros(len(grid), dtype=np.bool_)
    period = grid[1] - grid[0]
    for row in gaps:
        begin, end = np.searchsorted(grid, (time[row] + 0.5 * period, time[row + 1] - 0.5 * period))
        inside[begin:end] = True
    return inside


def marks(grid: Floats, time: Floats, marked: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Carry marks on the rows at `time` over to `grid`: a row is marked where one it lies between is."""
    after = np.clip(np.searchsorted(time, grid - 1e-9), 0, len(time) - 1)
    before = np.clip(np.searchsorted(time, grid + 1e-9, side="right") - 1, 0, len(time) - 1)
    return np.asarray(marked[before] | marked[after])
