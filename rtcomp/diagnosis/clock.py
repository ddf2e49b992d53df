"""The clock of a budget: it stands still while kernels are compiled, which happens once on a machine."""

from __future__ import annotations

import threading
import time
from typing import Any

from numba.core import event


class _Stopwatch(event.Listener):  # type: ignore[misc, unused-ignore]
    """How long this process has been compiling kernels, or loading them, in whichever threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._depth, self._since, self._before = 0, 0.0, 0.0

    def on_start(self, _event: Any) -> None:
        """Count what begins: within it, what a kernel calls, and other threads that wait for their turn."""
        with self._lock:
            if self._depth == 0:
                self._since = time.monotonic()
            self._depth += 1

    def on_end(self, _event: Any) -> None:
        """Count what ends."""
        with self._lock:
            self._depth -= 1
            if self._depth == 0:
                self._before += time.monotonic() - self._since

    def read(self) -> float:
        """Return the seconds up to now."""
        with self._lock:
            return self._before + (time.monotonic() - self._since if self._depth else 0.0)


_STOPWATCH = _Stopwatch()
event.register("numba:compiler_lock", _STOPWATCH)


def compiling() -> float:
    """Return for how long (s) this process has been compiling kernels since the clock was first asked for."""
    return _STOPWATCH.read()


def now() -> float:
    """Return the time (s) since any moment, without that spent compiling."""
    return time.monotonic() - compiling()


def ends_at(budget: float, began: float | None = None) -> float:
    """Return when a budget (s) ends on this clock: counted from `began` (time.monotonic), or from now."""
    return now() + budget - (0.0 if began is None else time.monotonic() - began)


def until(ends: float, share: float) -> float:
    """Return the time at which a `share` of that which is left up to `ends` has passed."""
    moment = now()
    return moment + share * max(ends - moment, 0.0)
