"""Columns that were made before, by what they were made from."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.physics import Effect

KEPT, KEPT_ONCE = 2 * 10**8, 3 * 10**7
"""Bytes of columns that are kept for the next evaluation; those of a replicate, which is fitted once."""


class Cache:
    """Arrays by key, the least recently used dropped beyond so many bytes; threads may share it."""

    def __init__(self, most: int = KEPT) -> None:
        self._most, self._lock, self._size = most, threading.Lock(), 0
        self._found: dict[Hashable, list[Any]] = {}

    def get(self, key: Hashable) -> list[Any] | None:
        """Return what is kept for a key, None where nothing is."""
        with self._lock:
            if key in self._found:
                self._found[key] = value = self._found.pop(key)
                return value
        return None

    def of(self, key: Hashable, make: Callable[[], list[Any]]) -> list[Any]:
        """Return what `make` gave for `key` before, or gives now."""
        kept = self.get(key)
        if kept is not None:
            return kept
        value = make()
        with self._lock:
            if key not in self._found:
                self._found[key] = value
                self._size += _bytes(value)
            while self._size > self._most and len(self._found) > 1:
                self._size -= _bytes(self._found.pop(next(iter(self._found))))
        return value


def _bytes(value: list[Any]) -> int:
    arrays = [[v] if isinstance(v, np.ndarray) else list(vars(v).values()) for v in value]
    return sum(int(a.nbytes) for part in arrays for a in part)


@dataclass(frozen=True)
class Group:
    """Columns that belong together: their key, and how they are made, (K, p) or (K,) for each segment."""

    key: Hashable
    make: Callable[[], list[Floats]]
    times: Callable[[Floats], list[Floats]] | None = None
    """The sum of all columns times so many sizes, (K,) for each segment, where that is less work."""
    width: int = 1
    """Columns."""

    def summed(self, sizes: Floats) -> list[Floats]:
        """Return the sum of the columns times `sizes`, (width,): (K,) for each segment."""
        if self.times is not None:
            return self.times(sizes)
        return [m * sizes[0] if m.ndim == 1 else m @ sizes for m in self.make()]


def key_of(effects: Sequence[Effect]) -> Hashable:
    """Return what tells effects with their values from others, whatever their order."""
    return tuple(sorted(repr(e.to_dict()) for e in effects))
