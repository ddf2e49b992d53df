"""Signals that wait for a place where a run can end: between ticks, tasks or items.

Python runs a signal's handler between any two instructions of the main thread. Raised there, an interrupt can
come between taking a lock and knowing that it is taken; the lock is never given back, and whoever wants it
next (a thread that starts, a pool that shuts down) waits for ever. So no interrupt is raised while threads
are started or waited for: the signal is noted, and handed on where the code says so.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


class Stop:
    """Set by a signal; looked at where it is safe to stop."""

    def __init__(self) -> None:
        self.requested = False
        self.number: int = signal.SIGINT
        """The signal that asked first."""
        self._before: dict[int, object] = {}

    def hand_on(self) -> None:
        """Let the handler that stood before act on the signal that came, if one did (most raise)."""
        if self.requested:
            self._restore()
            self.requested = False
            signal.raise_signal(self.number)

    def _ask(self, number: int, _frame: FrameType | None) -> None:
        if not self.requested:
            self.number = number
            self.requested = True

    def _take(self) -> None:
        # Signals can be handled in the main thread only; elsewhere the caller sets `requested`.
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._ask)

    def _restore(self) -> None:
        while self._before:
            number, handler = self._before.popitem()
            signal.signal(number, handler)  # type: ignore[arg-type]


@contextlib.contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """Turn SIGINT and SIGTERM into a request, for as long as the block lasts; the caller acts on it.

    A second one changes nothing: it cannot cut short what the first set off, such as sending zero volts.
    """
    stop = Stop()
    stop._take()
    try:
        yield stop
    finally:
        stop._restore()


@contextlib.contextmanager
def signals_wait() -> Iterator[Stop]:
    """Let SIGINT and SIGTERM wait until `hand_on` is called, or the block ends."""
    with stop_on_signals() as stop:
        yield stop
    stop.hand_on()
