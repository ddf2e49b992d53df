"""A recording being written: HDF5 that opens everywhere, whatever happens to its writer.

One 1-D float64 dataset per column at the root, attribute ``unit``; metadata as root attributes; the
identifier's weights, decimated, in the group ``weights``, what happened in ``events``. Append-only, SWMR,
so that it can be read while it grows. The format is bounded to HDF5 1.10, the first with SWMR, so that older
readers (MATLAB) open it.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt
from h5py import h5a, h5f, h5p

from rtcomp.recording.events import Event, EventLog
from rtcomp.recording.superblock import clear_flags
from rtcomp.recording.writer import take_name
from rtcomp.units import COLUMN_UNITS, for_axis

Floats = npt.NDArray[np.float64]

CHUNK_ROWS = 2048
WEIGHTS_PERIOD = 0.1
"""s between two stored rows of weights."""
_WEIGHTS_CHUNK = 64
_CACHE_BYTES, _CACHE_SLOTS = 4 * 8 * CHUNK_ROWS, 31
"""Of each dataset: only its newest chunk is ever touched again. The library's own caches, 8 MB a dataset, let
a recorder grow by 120 MB in its first million rows."""
_CACHE_INDEX_BYTES = 262144
"""Of where the chunks lie: more than one flush leaves behind, so that nothing is written ahead of it. By
itself the library keeps 2 to 32 MB."""
TEXT_BYTES = 64
"""Room in an attribute whose text is set while the file is written: SWMR lets values change, not sizes."""


class RecordingFile:
    """An HDF5 recording open for appending; `flush` makes what was appended safe from a kill."""

    def __init__(
        self,
        path: Path,
        columns: Sequence[str],
        metadata: Mapping[str, Any],
        weights: int = 0,
        axis: str = "linear",
        overwrite: bool = False,
        later: Sequence[str] = (),
    ) -> None:
        """Create the file; raise OutputExistsError where there is one, OSError where the disk refuses.

        With `overwrite`, one that is there is replaced once the new one stands. `later` names attributes
        (short texts) whose values `fill` sets when they are known.
        """
        self._descriptor = -1
        temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
        try:
            self._file = _create(temporary)
            self._columns = [self._dataset(self._file, c, COLUMN_UNITS.get(c, "1"), axis) for c in columns]
            self._weights_time = self._weights = None
            self._next_weights = -np.inf
            if weights:
                group = self._file.create_group("weights")
                self._weights_time = self._dataset(group, "time", "s", axis)
                self._weights = group.create_dataset(
                    "weights", (0, weights), "f8", maxshape=(None, weights), chunks=(_WEIGHTS_CHUNK, weights)
                )
            self._events = EventLog(self._file, list(columns))
            for key, value in metadata.items():
                self._file.attrs[key] = _attribute(value)
            self._file.attrs["format"] = "rtcomp recording 1"
            self._file.attrs["complete"] = np.int64(0)
            self._file.attrs["rows_lost"] = np.int64(0)
            for key, value in {"ended": b"no", **dict.fromkeys(later, b"unknown")}.items():
                self._file.attrs.create(key, value, dtype=f"S{TEXT_BYTES}")
            self._file.swmr_mode = True  # from here on: no new names, only more rows
            self._descriptor = os.open(temporary, os.O_RDWR | os.O_CLOEXEC)
            fcntl.flock(self._descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
            self._reserve = 8 * (3 * CHUNK_ROWS * len(columns) + 3 * _WEIGHTS_CHUNK * weights) + 65536
            self._end = clear_flags(self._descriptor)
            self.reserve()
            if overwrite:
                temporary.replace(path)
            else:
                take_name(temporary, path)
        except BaseException:
            self.abandon()
            raise
        finally:
            temporary.unlink(missing_ok=True)
        self.rows = 0
        self._unflushed = 0

    @staticmethod
    def _dataset(group: Any, name: str, unit: str, axis: str) -> Any:
        dataset = group.create_dataset(name, (0,), "f8", maxshape=(None,), chunks=(CHUNK_ROWS,))
        dataset.attrs["unit"] = for_axis(unit, axis)
        return dataset

    def append(self, rows: Floats) -> None:
        """Append `rows` of shape (n, columns + weights), time (s) first; weights are decimated by it.

        At most CHUNK_ROWS rows at once; `flush` when `full` says so.
        """
        if not len(rows):
            return
        end = self.rows + len(rows)
        for i, dataset in enumerate(self._columns):
            dataset.resize((end,))
            dataset[self.rows : end] = rows[:, i]
        self.rows = end
        self._unflushed += len(rows)
        self._events.watch(rows)
        if self._weights is not None and self._weights_time is not None:
            chosen = self._due(rows[:, 0])
            if chosen:
                at, to = len(self._weights_time), len(self._weights_time) + len(chosen)
                self._weights.resize(to, axis=0)
                self._weights[at:to] = rows[chosen, len(self._columns) :]
                self._weights_time.resize((to,))
                self._weights_time[at:to] = rows[chosen, 0]

    def add(self, event: Event) -> None:
        """Append an event to the group ``events``."""
        self._events.add(event)

    def _due(self, time: Floats) -> list[int]:
        """Return which of the rows at `time` begin a new period of the weights."""
        chosen: list[int] = []
        at = 0
        while at < len(time):
            at += int(np.searchsorted(time[at:], self._next_weights - 1e-9))
            if at < len(time):
                chosen.append(at)
                self._next_weights = float(time[at]) + WEIGHTS_PERIOD
                at += 1
        return chosen

    def flush(self) -> None:
        """Hand everything to the file system, in an order in which any prefix of it is a valid file."""
        self._file.flush()
        self._end = clear_flags(self._descriptor)
        self._unflushed = 0

    @property
    def full(self) -> bool:
        """Whether so much was appended since the last flush that the next rows wait for one."""
        return self._unflushed >= CHUNK_ROWS

    def reserve(self) -> None:
        """Have the disk set aside what the next rows will need; raise OSError where it has not got it.

        To be called after `flush`. A library that runs out of space in the middle of a flush leaves rows
        counted but not written; this way the disk is found full between two flushes, with everything
        recorded so far in order.
        """
        size = os.fstat(self._descriptor).st_size
        if size < self._end + self._reserve:
            os.posix_fallocate(self._descriptor, size, self._end + 2 * self._reserve - size)

    def mark(self, complete: bool, rows_lost: int, ended: str) -> None:
        """Write how the run ended into the root attributes, in place (SWMR allows no new ones)."""
        self._set("complete", np.int64(complete))
        self._set("rows_lost", np.int64(rows_lost))
        self.fill({"ended": ended})

    def fill(self, values: Mapping[str, str]) -> None:
        """Set texts announced as `later`, in place, cut to TEXT_BYTES; the next flush makes them safe."""
        for name, text in values.items():
            self._set(name, np.bytes_(text.encode()[:TEXT_BYTES]))

    def _set(self, name: str, value: Any) -> None:
        attribute = h5a.open(self._file.id, name.encode())
        attribute.write(np.array(value, dtype=attribute.dtype))

    def close(self) -> None:
        """Close as the library does it, and give back the space that was not needed."""
        self._file.close()
        os.ftruncate(self._descriptor, clear_flags(self._descriptor))
        os.close(self._descriptor)
        self._descriptor = -1

    def abandon(self) -> None:
        """Let go of a file that cannot be written any more, with what was flushed in it."""
        if self._descriptor >= 0:
            with contextlib.suppress(OSError, ValueError):  # the caller reports why it could not be written
                clear_flags(self._descriptor)
            os.close(self._descriptor)
            self._descriptor = -1


def _create(path: Path) -> Any:
    """Create an HDF5 file whose root attributes lie in the object header, where they change in place."""
    creation = h5p.create(h5p.FILE_CREATE)
    creation.set_attr_phase_change(1000, 900)
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_libver_bounds(h5f.LIBVER_V110, h5f.LIBVER_V110)
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    access.set_cache(0, _CACHE_SLOTS, _CACHE_BYTES, 1.0)
    about = access.get_mdc_config()
    about.set_initial_size = True
    about.initial_size = about.min_size = about.max_size = _CACHE_INDEX_BYTES
    access.set_mdc_config(about)
    return h5py.File(h5f.create(os.fsencode(path), h5f.ACC_EXCL, creation, access))


def _attribute(value: Any) -> Any:
    """Return `value` as something an attribute holds: text, numbers, arrays as they are, the rest as JSON."""
    if isinstance(value, bool):
        return np.int64(value)
    if isinstance(value, str | int | float | np.ndarray | np.generic):
        return value
    return json.dumps(value)
