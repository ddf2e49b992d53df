"""Reading a recording, whoever wrote it: CSV, CSV.gz, MAT 5 and 7.3, HDF5.

What comes back is evenly sampled, finite and in order, or there is one clear line that says why not.
Everything done on the way stands in `Recording.notes`.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rtcomp.errors import ConfigError, RecordingError
from rtcomp.recording import table as tables
from rtcomp.recording.events import Event
from rtcomp.recording.pieces import pieces, steps
from rtcomp.recording.sampling import METHODS, Sampling, examine, in_gap, marks, resample
from rtcomp.recording.table import Floats, Table

NEEDED = ("time", "position", "voltage")
MIN_ROWS = 16
_MOST_GROWTH = 4
"""Even rows made per row read, at most: beyond, the gaps are most of the recording."""


@dataclass(frozen=True)
class Recording:
    """One table, rows equally spaced at `rate_hz`."""

    columns: dict[str, Floats]
    """By name, all 1-D float64 of one length. ``outlier`` and ``gap`` are 1 where a row is doubtful."""
    rate_hz: float
    metadata: dict[str, Any] = field(default_factory=dict)
    path: Path = Path()
    notes: list[str] = field(default_factory=list)
    """What was done on reading, one line each, for a person."""
    weights: Floats | None = None
    """The identifier's weights as they were learnt, (rows, N) at `weights_time`; None where not recorded."""
    weights_time: Floats | None = None
    """s."""
    events: list[Event] = field(default_factory=list)
    """What happened in the run, in order; empty where it was not recorded."""

    def __len__(self) -> int:
        return len(self.columns["time"])

    @property
    def time(self) -> Floats:
        """Time, s."""
        return self.columns["time"]

    @property
    def position(self) -> Floats:
        """Measured position, m (rad)."""
        return self.columns["position"]

    @property
    def voltage(self) -> Floats:
        """Command, V, held until the next row."""
        return self.columns["voltage"]

    @property
    def reference(self) -> Floats | None:
        """Where the stage was told to be, m (rad); None for an open-loop recording."""
        return self.columns.get("reference")

    @property
    def trusted(self) -> npt.NDArray[np.bool_]:
        """Rows that are neither marked as outliers nor lie in a gap."""
        bad = np.zeros(len(self), dtype=np.bool_)
        for name in ("outlier", "gap"):
            if name in self.columns:
                bad |= self.columns[name] != 0
        return ~bad


def read(
    path: str | os.PathLike[str],
    column_map: Mapping[str, str] | None = None,
    *,
    rate_hz: float | None = None,
    method: str = "cubic",
    needed: Sequence[str] = NEEDED,
    mark_outliers: bool = True,
    only: Sequence[str] | None = None,
) -> Recording:
    """Read the recording at `path`, a file, or a folder that holds one recording and no more.

    `column_map` says which column of the file is which: ``{"position": "qm"}``. Uneven rows are resampled
    to `rate_hz` (default: their median rate) by `method` ``cubic`` or ``linear``; even rows only where
    `rate_hz` asks for another rate than theirs. A file without ``time`` is read at the given `rate_hz`.
    Outliers of position and voltage are marked in the column ``outlier``, rows bridged across gaps in the
    column ``gap``; nothing is removed but second rows of the same time. With `only`, other columns than
    these and the mapped ones are left in the file where it is large: an hour at 10 kHz fits into memory.

    Raises RecordingError where the file is missing, truncated, not what its name says, lacks a column of
    `needed` or a mapped one, holds NaN or infinity in `needed` or ``reference``, a constant position, time
    that goes back, or too few rows; ConfigError where `rate_hz` or `method` make no sense.
    """
    path = Path(path)
    if rate_hz is not None and not 0.0 < rate_hz < 1e7:
        raise ConfigError(f"rate is {rate_hz:g} Hz; allowed is (0, 1e7)")
    if method not in METHODS:
        raise ConfigError(f"resampling method is {method!r}; it must be one of {', '.join(METHODS)}")
    if path.is_dir():
        path = tables.recording_in(path)
    mapping = column_map or {}
    table = load(path, None if only is None else {*mapping.values(), *only})
    if only is not None and not {*mapping.values(), *needed} <= {*table.columns, *mapping}:
        table = load(path)  # to say what is there instead
    _rename(path, table, mapping)
    _one_length(path, table, needed, rate_hz)
    if only is not None:
        table.columns = {name: column for name, column in table.columns.items() if name in {*only, *mapping}}
    _check(path, table.columns, needed)
    _drop_repeated_times(table)
    sampling = examine(table.columns["time"])
    columns, rate = _even(path, table, sampling, rate_hz, method, mark_outliers)
    weights_time, weights = table.weights or (None, None)
    return Recording(columns, rate, table.metadata, path, table.notes, weights, weights_time, table.events)


def load(path: Path, only: Collection[str] | None = None) -> Table:
    """Read the file at `path` as it is, nothing checked but that it is whole; raise RecordingError.

    Of a large file, columns not in `only` may be left out.
    """
    found = tables.kind(path)
    if found == tables.HDF5:
        from rtcomp.recording.containers import read_hdf5

        return read_hdf5(path, only)
    if found == tables.MAT5:
        from rtcomp.recording.containers import read_mat5

        return read_mat5(path)
    from rtcomp.recording.text import read_text

    return read_text(path, found == tables.GZIP, only)


def parse_map(items: Iterable[str]) -> dict[str, str]:
    """Return ``{"position": "qm"}`` from ``["position=qm"]``; raise ConfigError for anything else."""
    mapping: dict[str, str] = {}
    for item in items:
        name, equals, source = (part.strip() for part in item.partition("="))
        if not (name and equals and source):
            raise ConfigError(f"--map {item!r}: write NAME=COLUMN, for example position=qm")
        if name in mapping:
            raise ConfigError(f"--map {item!r}: {name!r} is mapped twice")
        mapping[name] = source
    return mapping


def _rename(path: Path, table: Table, column_map: Mapping[str, str]) -> None:
    found = table.columns
    for name, source in column_map.items():
        if source not in found:
            near = difflib.get_close_matches(source, found, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise RecordingError(f"{path}: has no column {source!r} for {name}; found {_listed(found)}{hint}")
    renamed = {name: found[source] for name, source in column_map.items()}
    for name in renamed:
        if name in found and name not in column_map.values():
            table.notes.append(f"the file's own column {name!r} is replaced by {column_map[name]!r}")
    kept = {k: v for k, v in found.items() if k not in renamed and k not in column_map.values()}
    table.columns = renamed | kept


def _one_length(path: Path, table: Table, needed: Sequence[str], rate_hz: float | None) -> None:
    """Check that the needed columns are there and of one length; put aside what is of another."""
    columns = table.columns
    if "time" not in columns and rate_hz is not None and all(n in columns for n in needed if n != "time"):
        rows = max((len(columns[n]) for n in needed if n in columns), default=0)
        columns["time"] = np.arange(rows) / rate_hz
        table.notes.append(f"the file has no time: rows taken as {rate_hz:g} Hz")
    missing = [name for name in ("time", *needed) if name not in columns]
    if missing:
        raise RecordingError(
            f"{path}: has no column {_listed(dict.fromkeys(missing))}; found {_listed(columns)}; "
            f"name it with --map {missing[0]}=COLUMN"
        )
    rows = len(columns["time"])
    for name in needed:
        if len(columns[name]) != rows:
            raise RecordingError(f"{path}: {name} has {len(columns[name])} rows, time has {rows}")
    for name in [name for name, column in columns.items() if len(column) != rows]:
        table.notes.append(f"column {name!r} has {len(columns.pop(name))} rows, time has {rows}: left out")
    table.columns = {"time": columns.pop("time"), **columns}
    if rows < MIN_ROWS:
        raise RecordingError(f"{path}: has {_count(rows, 'row')}; at least {MIN_ROWS} are needed")


def _check(path: Path, columns: Mapping[str, Floats], needed: Sequence[str]) -> None:
    for name in dict.fromkeys(("time", *needed, "reference")):
        if name not in columns:
            continue
        bad = ~np.isfinite(columns[name])  # a byte a row
        if bad.any():
            first = int(np.argmax(bad))
            value = "NaN" if np.isnan(columns[name][first]) else "infinite"
            raise RecordingError(
                f"{path}: {name} is {value} in row {first + 1}; {int(bad.sum())} of its {len(bad)} values "
                "are not finite; cut them out or repair them first"
            )
    time = columns["time"]
    for first, step in steps(time):
        if (step < 0).any():
            row = first + int(np.argmax(step < 0)) + 1
            raise RecordingError(
                f"{path}: time goes back in row {row + 1}, from {time[row - 1]:.9g} s to {time[row]:.9g} s; "
                "it must increase (two recordings in one file?)"
            )
    if time[-1] == time[0]:
        raise RecordingError(f"{path}: time is {time[0]:g} s in every row")
    if "position" in needed:
        position = columns["position"]
        if np.ptp(position) <= 1e-15 * max(abs(float(position.max())), abs(float(position.min()))):
            raise RecordingError(
                f"{path}: position is constant ({position[0]:g} in all {len(position)} rows); nothing moved, "
                "or the wrong column is mapped"
            )


def _drop_repeated_times(table: Table) -> None:
    """Keep the first of rows that share a time."""
    time = table.columns["time"]
    if any((step == 0).any() for _, step in steps(time)):
        again = np.diff(time, prepend=-np.inf) == 0
        first = int(np.argmax(again)) + 1
        table.notes.append(
            f"{_count(again.sum(), 'row')} of a time already seen (first: row {first}): left out"
        )
        table.columns = {name: column[~again] for name, column in table.columns.items()}


def _even(
    path: Path, table: Table, sampling: Sampling, wanted: float | None, method: str, mark_outliers: bool
) -> tuple[dict[str, Floats], float]:
    """Return the columns evenly spaced, with their rate (Hz), outliers and gaps marked."""
    columns, notes = table.columns, table.notes
    time = columns["time"]
    marked = _marked(columns, notes) if mark_outliers else np.zeros(len(time), dtype=np.bool_)
    same = wanted is None or abs(wanted / sampling.rate_hz - 1.0) < 1e-3
    rate = sampling.rate_hz if wanted is None else wanted
    if sampling.even and same:
        if sampling.jitter > 1e-3:
            even_time = np.empty_like(time)
            for part in pieces(len(time)):
                even_time[part] = time[0] + np.arange(part.start, part.stop) / rate
            columns["time"] = even_time
        if sampling.jitter > 1e-2:
            notes.append(
                f"time stamps jitter by {100 * sampling.jitter:.0f} % of the period at most: taken as even"
            )
        even = columns
    else:
        intervals = np.diff(time)
        if (time[-1] - time[0]) * min(rate, sampling.rate_hz) > _MOST_GROWTH * len(time):
            row = int(np.argmax(intervals)) + 2
            raise RecordingError(
                f"{path}: time jumps by {intervals.max():.4g} s in row {row}, and rows are mostly missing at "
                f"{rate:g} Hz; cut the recording there"
            )
        even = resample(columns, rate, sampling, method)
        why = (
            f"{sampling.rate_hz:.6g} Hz"
            if sampling.even
            else f"uneven rows, {intervals.min() * 1e3:.4g} to {intervals.max() * 1e3:.4g} ms apart"
        )
        how = "motion by a monotone cubic, the rest linearly" if method == "cubic" else "linearly"
        low = ", low-passed below the new Nyquist frequency" if rate < 0.95 * sampling.rate_hz else ""
        notes.append(f"resampled from {why}, to {rate:.6g} Hz ({len(even['time'])} rows): {how}{low}")
        if len(sampling.gaps):
            gap = in_gap(even["time"], time, sampling.gaps)
            even["gap"] = gap.astype(np.float64)
            longest = int(np.argmax(intervals))
            notes.append(
                f"{_count(len(sampling.gaps), 'gap')}, longest {intervals[longest]:.4g} s at "
                f"{time[longest]:.6g} s: {_count(gap.sum(), 'row')} bridged and marked in column 'gap'"
            )
        marked = marks(even["time"], time, marked)
    if marked.any() or "outlier" in even:
        even["outlier"] = np.maximum(even.get("outlier", np.zeros(len(marked))), marked)
    return even, rate


def _marked(columns: Mapping[str, Floats], notes: list[str]) -> npt.NDArray[np.bool_]:
    from rtcomp.recording.outliers import COMMAND_THRESHOLD, THRESHOLD, answers, lawful, outliers

    marked = np.zeros(len(columns["time"]), dtype=np.bool_)
    for name, threshold in (("position", THRESHOLD), ("voltage", COMMAND_THRESHOLD)):
        if name in columns:
            found = outliers(columns[name], threshold)
            if name == "voltage" and found.any():
                inputs = [columns[one] for one in ("position", "reference") if one in columns]
                for one in inputs:
                    found &= ~answers(one)
                found &= ~lawful(columns["voltage"], inputs, found)
            marked |= found
            if found.any():
                at = columns["time"][int(np.argmax(found))]
                many = _count(found.sum(), "outlier")
                notes.append(f"{many} in {name} (first at {at:.6g} s): marked in column 'outlier'")
    return marked


def _count(number: Any, what: str) -> str:
    return f"{int(number)} {what}{'' if number == 1 else 's'}"


def _listed(names: Iterable[str]) -> str:
    names = list(names)
    shown = ", ".join(repr(name) for name in names[:20])
    return f"{shown} and {len(names) - 20} more" if len(names) > 20 else shown or "none"
