"""The ring in shared memory: how the loop hands each tick over to other processes without ever waiting.

One writer, any number of readers, one row of float64 a tick. Layout: a header of sixteen int64, then
`capacity` rows of `width` float64. The writer fills the row, then counts it; it never looks at readers
except at the recorder's mark, to count rows that the recorder had no chance to take, and at the mark by which
any other process stops it.
The memory is anonymous (no name that could leak or be squatted) and is inherited as a file descriptor.
The compiled writer is `rtcomp.loop.push`: readers in other processes need not load a compiler.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

MAGIC, CAPACITY, WIDTH, WRITTEN, TAKEN, CLOSED, LOST, FLUSHED, STOPPED = range(9)
"""Places in the header: magic, rows, columns, rows ever written, rows the recorder has taken, writer has
closed (0 running, 1 complete, 2 ended by an error), rows overwritten before they were taken, rows that the
recorder has handed to the file system, emergency stop asked for (0 for none, else `stop` says by what)."""

_MAGIC = 0x72746370  # "rtcp"
_HEADER = 16
_HEADER_BYTES = 8 * _HEADER


class Ring:
    """A ring of rows in shared memory; create it in the loop's process, attach to it elsewhere."""

    def __init__(self, descriptor: int, memory: mmap.mmap, capacity: int, width: int) -> None:
        self.descriptor = descriptor
        self._memory = memory
        self.header: np.ndarray = np.frombuffer(memory, dtype=np.int64, count=_HEADER)
        self.rows: Floats = np.frombuffer(memory, dtype=np.float64, offset=_HEADER_BYTES).reshape(
            capacity, width
        )

    @classmethod
    def create(cls, capacity: int, width: int) -> Ring:
        """Make a ring of `capacity` rows of `width` float64, all pages touched before use."""
        size = _HEADER_BYTES + 8 * capacity * width
        if hasattr(os, "memfd_create"):
            descriptor = os.memfd_create("rtcomp-ring")
        else:
            handle, path = tempfile.mkstemp(prefix="rtcomp-ring-")
            Path(path).unlink()
            descriptor = handle
        os.ftruncate(descriptor, size)
        ring = cls(descriptor, mmap.mmap(descriptor, size), capacity, width)
        ring.rows[:] = 0.0
        ring.header[:] = 0
        ring.header[[MAGIC, CAPACITY, WIDTH]] = _MAGIC, capacity, width
        return ring

    @classmethod
    def attach(cls, descriptor: int) -> Ring:
        """Open the ring behind an inherited file descriptor."""
        memory = mmap.mmap(descriptor, os.fstat(descriptor).st_size)
        header = np.frombuffer(memory, dtype=np.int64, count=_HEADER)
        if int(header[MAGIC]) != _MAGIC:
            raise ValueError("the inherited descriptor is not a ring")
        return cls(descriptor, memory, int(header[CAPACITY]), int(header[WIDTH]))

    @property
    def written(self) -> int:
        """Rows written since the start."""
        return int(self.header[WRITTEN])

    @property
    def capacity(self) -> int:
        """Rows that fit."""
        return int(self.header[CAPACITY])

    @property
    def waiting(self) -> int:
        """Rows that the recorder has not taken yet."""
        return int(self.header[WRITTEN] - self.header[TAKEN])

    def take(self, most: int = 1 << 62) -> Floats:
        """Take the rows that wait, oldest first, as a copy of shape (rows, width). For the one recorder.

        Rows overwritten before or while they were copied are left out and counted in the header's LOST.
        """
        capacity = int(self.header[CAPACITY])
        written, taken = int(self.header[WRITTEN]), int(self.header[TAKEN])
        writing = int(self.header[CLOSED] == 0)
        start = max(taken, written - capacity)
        end = min(written, start + most)
        rows: Floats = self.rows[np.arange(start, end) % capacity]
        # The row being written at this moment, not yet counted, sits on the oldest one.
        whole = min(max(start, int(self.header[WRITTEN]) + writing - capacity), end)
        self.header[LOST] += whole - taken
        self.header[TAKEN] = end
        return rows[whole - start :]

    def close(self, ended: int = 1) -> None:
        """Tell readers that no more rows will come; `ended` is 1 for complete, 2 for ended by an error."""
        self.header[CLOSED] = ended

    def stop(self, by: int = 1) -> None:
        """Stop the loop at its next tick, at zero volts, latched: an emergency stop. From any process."""
        self.header[STOPPED] = by

    def release(self) -> None:
        """Close the descriptor; the memory itself goes with the last array on it. Safe to call twice."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1
