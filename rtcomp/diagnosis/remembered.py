"""Results kept for the next who asks: what is done to one entry leaves most of the others as it was."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

from rtcomp.kernels import Floats

Result = TypeVar("Result")


class Remembered(Generic[Result]):
    """The `most` results asked for last, of functions that always give the same; threads may share it."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._results: dict[Hashable, Result] = {}
        self._lock = threading.Lock()

    def of(self, key: Hashable, make: Callable[[], Result]) -> Result:
        """Return what `make` gave when `key` was last asked for, or what it gives now."""
        with self._lock:
            if key in self._results:
                self._results[key] = found = self._results.pop(key)
                return found
        found = make()  # not under the lock: two may make the same, which is the same
        with self._lock:
            self._results[key] = found
            while len(self._results) > self._most:
                self._results.pop(next(iter(self._results)))
        return found


class Memory:
    """What ledgers of one stage and motion have in common, whatever their reaches."""

    def __init__(self) -> None:
        self.paths: Remembered[list[tuple[Floats, Floats, Floats]]] = Remembered(4)
        """True position, velocity and acceleration of each strip."""
        self.drives: Remembered[list[Floats]] = Remembered(16)
        """Force of the drive (N) around the rows of each strip."""
        self.loads: Remembered[list[Floats]] = Remembered(4)
        """Position (m) of the load behind a play along each strip."""
        self.frictions: Remembered[Floats] = Remembered(48)
        """Units of friction on the kept rows: of the entries refined together, of the reaches tried."""
