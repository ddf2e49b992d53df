"""Recordings as the diagnosis sees them: segments of equal rate, and how the command goes between rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rtcomp.diagnosis.recordings.counts import count_of
from rtcomp.diagnosis.recordings.jumps import MOST, Jump, jumps
from rtcomp.diagnosis.recordings.stretches import LEAST_ROWS, stretches
from rtcomp.kernels import Floats
from rtcomp.physics import Effect
from rtcomp.recording.pieces import bridged
from rtcomp.recording.reader import Recording
from rtcomp.stage.sensed import true_position

MOST_ROWS = 36_000
"""Rows of the recording that are used as they are; of longer ones windows are taken, evenly spread."""
OVERSAMPLED = 8.0
"""Least rate of averaged rows over the motion's bandwidth. At 4 what averages make of a reversal, in which
friction and speed change within a few rows, was up to ten times the sensor's noise; at 8 it is below that."""
BEFORE = 10_000
"""Rows, at most, of the way to a window."""
RUN_IN = 0.2
"""Part of a window that is not compared."""
FORGOTTEN = 0.95
"""Part of the stroke after which friction has forgotten what was before: twice what may yield at all."""
WINDOWS = 4
"""Windows of a long recording."""


@dataclass(frozen=True)
class Segment:
    """One uninterrupted part: time (s), position (m), voltage (V), reference (m) or None; each (K,)."""

    time: Floats
    position: Floats
    voltage: Floats
    reference: Floats | None
    source: Segment | None = None
    """The rows as recorded, where these are means of them."""
    before: Floats | None = None
    """Times (s) and positions (m), (2, M), on the way to its first row, where the recording began earlier:
    friction remembers, and what swings."""
    run_in: int = 0
    """First rows that are not compared: what lags has no state at the beginning of a window."""
    finer: Floats | None = None
    """Where rows are means: what second differences of these see of a command beyond held means (V, (K,))."""

    def part(self, rows: slice) -> Segment:
        """Return some of its rows."""
        reference = None if self.reference is None else self.reference[rows]
        source = self.source
        if source is not None:
            factor = source.time.size // self.time.size
            source = source.part(slice(rows.start * factor, rows.stop * factor))
        finer = None if self.finer is None else self.finer[rows]
        return Segment(
            self.time[rows], self.position[rows], self.voltage[rows], reference, source, finer=finer
        )


@dataclass(frozen=True)
class Data:
    """Segments at one rate (Hz); `held` tells whether the command is held from row to row or band-limited."""

    segments: tuple[Segment, ...]
    rate: float
    held: bool
    averaged: int = 1
    """Rows of the recording in one of these."""
    early: float = 0.0
    """Rows by which a held command acts before its own row, 0 to 1."""
    count: float = 0.0
    """m, by which readings go, as they tell it; 0 where they do not."""

    @property
    def period(self) -> float:
        """Time between rows (s)."""
        return 1.0 / self.rate

    @property
    def stroke(self) -> tuple[float, float]:
        """Lowest and highest position (m)."""
        lows, highs = zip(*[(s.position.min(), s.position.max()) for s in self.segments], strict=True)
        return float(min(lows)), float(max(highs))

    @property
    def seconds(self) -> float:
        """Length of all segments (s)."""
        return float(sum(s.time.size for s in self.segments)) / self.rate

    @property
    def last(self) -> float:
        """Time (s) of a run at its last row, gaps included."""
        return max(float(s.time[-1]) for s in self.segments)

    @cached_property
    def jumps(self) -> list[Jump]:
        """The clearest steps of the reading that are unlike those before and after them."""
        found = [j for s in self.as_recorded().segments for j in jumps(s.time, s.position)]
        return sorted(found, key=lambda j: -j.clear)[:MOST]

    def as_recorded(self) -> Data:
        """Return the rows that these are means of."""
        sources = tuple(s.source or s for s in self.segments)
        return Data(sources, self.rate * self.averaged, self.held, count=self.count)


def load_data(recordings: Sequence[Recording], *, held: bool = True, bandwidth: float = 0.0) -> Data:
    """Return the recordings (of one rate) as segments: without long gaps, windows of very long ones.

    Where the `bandwidth` (Hz) of the motion is known, too many rows far beyond it are averaged.
    """
    rate = recordings[0].rate_hz
    found = [s for r in recordings for s in _segments(r)]
    many = -(-sum(s.time.size for s in found) // MOST_ROWS)
    factor = max(1, min(many, int(rate / (OVERSAMPLED * bandwidth)))) if bandwidth else 1
    if factor > 1:
        found, rate = [averaged(s, factor) for s in found], rate / factor
    rows = sum(s.time.size for s in found)
    if rows > MOST_ROWS:
        size = MOST_ROWS // WINDOWS
        share = max(WINDOWS // len(found), 1)
        found = [w for s in found for w in _windows(s, share, size)]
    return Data(tuple(found), rate, held, factor, count=count_of(recordings))


def _segments(recording: Recording) -> list[Segment]:
    position = bridged(recording.position, recording.trusted)
    time = recording.time - recording.time[0]
    whole = Segment(time, position, recording.voltage, recording.reference)
    found = [_after(whole, rows) for rows in stretches(recording.trusted)]
    return [s for s in found if s.time.size >= LEAST_ROWS // 2] or [whole]


def _after(whole: Segment, rows: slice) -> Segment:
    """Return some rows with the way there: what was not measured is bridged.

    What that has wrong friction forgets once it has gone far enough one way; till then nothing is compared.
    """
    part = whole.part(rows)
    if not rows.start:
        return part
    gone = np.maximum.accumulate(part.position) - np.minimum.accumulate(part.position)
    far = int(np.searchsorted(gone, FORGOTTEN * float(np.ptp(whole.position))))
    return replace(part, before=way_to(whole, rows.start), run_in=min(far, int(RUN_IN * gone.size)))


def way_to(segment: Segment, to: int) -> Floats:
    """Return times and positions on the way to a row, (2, M), also those before the segment; some of all."""
    rows = slice(to, None, -max(1, segment.position.size // BEFORE))
    way = np.stack([segment.time[rows], segment.position[rows]])[:, ::-1]
    return way if segment.before is None else np.concatenate([segment.before[:, :-1], way], axis=1)


def averaged(segment: Segment, factor: int) -> Segment:
    """Return means of so many rows each; a command is held from the middle of its rows to the next."""
    count = segment.time.size // factor
    used = segment.part(slice(0, count * factor))

    def mean(a: Floats) -> Floats:
        return np.asarray(a.reshape(count, factor).mean(axis=1))

    given = np.concatenate([[0.0], np.cumsum(segment.voltage)])
    edges = np.arange(count + 1) * factor + 0.5 * (factor - 1)
    held = np.diff(np.interp(edges, np.arange(given.size), given)) / factor
    reference = None if used.reference is None else mean(used.reference)
    seen = _seen(used.voltage, factor)
    seen[1:] -= 0.5 * (held[1:] + held[:-1])
    seen[[0, -1]] = 0.0
    return Segment(
        mean(used.time), mean(used.position), held, reference, used, segment.before,
        segment.run_in // factor, seen,
    )  # fmt: skip


def _seen(command: Floats, factor: int) -> Floats:
    """Return a held command (K,) as second differences of means of so many rows see it, (K / factor,).

    Those of single rows see the mean of what was held before and after each. That of means is a sum of them,
    weighed by a triangle over the rows before and after, once for each row of a mean.
    """
    around = 0.5 * (command + np.append(command[:1], command[:-1]))
    triangle = factor - np.abs(np.arange(1 - factor, factor))
    weights = np.convolve(triangle, np.ones(factor)) / factor**3
    padded = np.pad(around, (factor - 1, factor - 1), mode="edge")
    return np.convolve(padded, weights, mode="valid")[::factor]


def behind_reading(segment: Segment, sensors: Sequence[Effect]) -> Floats:
    """Return the position (m) behind a reading; where rows are means, the mean of what is behind each."""
    source = segment.source
    if not sensors or source is None:
        return true_position(sensors, segment.time, segment.position)
    x = true_position(sensors, source.time, source.position)
    return np.asarray(x.reshape(segment.time.size, -1).mean(axis=1))


def _windows(segment: Segment, count: int, rows: int) -> list[Segment]:
    if segment.time.size <= count * rows:
        return [segment]
    starts = np.linspace(0, segment.time.size - rows, count).astype(np.int64)
    starts = with_rows(starts, _telling(segment), rows, segment.time.size)
    return [
        replace(
            segment.part(slice(k, k + rows)),
            before=way_to(segment, k),
            run_in=int(RUN_IN * rows) if k else segment.run_in,
        )
        for k in starts.tolist()
    ]


def _telling(segment: Segment) -> list[int]:
    """Return rows that should be compared: what happens once, or at an extreme only, is seen nowhere else."""
    seen = segment.source or segment
    found = [int(np.searchsorted(segment.time, jump.time)) for jump in jumps(seen.time, seen.position)[:1]]
    size = segment.time.size
    speed = np.gradient(segment.position[:: max(1, size // BEFORE)])
    for signal in (segment.voltage, segment.position, speed):
        found += [int(furthest(signal)) * size // signal.size for furthest in (np.argmin, np.argmax)]
    return found


def with_rows(starts: np.ndarray, wanted: Sequence[int], rows: int, size: int) -> np.ndarray:
    """Return starts (W,) of windows of so many `rows`, moved to compare the `wanted` ones if they can.

    The first of these come first: a window that compares one stays where it is.
    """
    pinned: set[int] = set()
    for row in wanted:
        first = starts + np.where(starts > 0, int(RUN_IN * rows), 0)
        sees = np.flatnonzero((first <= row) & (row < starts + rows))
        if sees.size:
            pinned.add(int(sees[0]))
            continue
        near = np.clip(starts, row - int(0.9 * rows), row - int(1.5 * RUN_IN * rows))
        near = np.clip(near, 0, size - rows)
        for k in np.argsort(np.abs(near - starts)).tolist():
            moved = _apart(starts, k, int(near[k]), rows)
            stays = all(moved[i] == starts[i] for i in pinned)
            if k not in pinned and stays and moved[0] >= 0 and moved[-1] <= size - rows:
                starts = moved
                pinned.add(k)
                break
    return starts


def _apart(starts: np.ndarray, at: int, to: int, rows: int) -> np.ndarray:
    """Return starts (W,) with one put elsewhere, and others out of its way."""
    found = starts.copy()
    found[at] = to
    for k in range(at + 1, found.size):
        found[k] = max(found[k], found[k - 1] + rows)
    for k in range(at - 1, -1, -1):
        found[k] = min(found[k], found[k + 1] - rows)
    return found


def reversals(position: Floats) -> int:
    """Return how often a position (m) turns back by more than a fiftieth of its range."""
    reach = 0.02 * float(np.ptp(position))
    count, way = 0, 0
    low = high = float(position[0])
    for value in position[:: max(1, position.size // 20_000)].tolist():
        low, high = min(low, value), max(high, value)
        if way <= 0 and value > low + reach:
            count += way < 0
            way, high, low = 1, value, value
        elif way >= 0 and value < high - reach:
            count += way > 0
            way, low, high = -1, value, value
    return count
