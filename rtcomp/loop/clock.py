"""The only thing that differs between a simulation and a run on hardware: what a deadline waits for."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Absolute deadlines: tick k is due at start + k * period."""

    def start(self, period: float) -> None:
        """Set the time of tick 0 to now."""

    def wait(self, tick: int) -> float:
        """Return when tick number `tick` is due: the lateness (s), 0 or more."""


class VirtualClock:
    """Every deadline is met: time passes as fast as the machine computes."""

    def start(self, period: float) -> None:
        """Nothing to prepare."""

    def wait(self, tick: int) -> float:
        """Return at once, never late."""
        return 0.0


class WallClock:
    """Monotonic time. Sleeps until shortly before the deadline, then spins.

    `spin` (s) is how long to spin at the most. Spinning trims the wake-up from tens of microseconds to
    below one, but a SCHED_FIFO process that spins all the time is throttled by the kernel, so it is never
    more than a quarter of the period.
    """

    def __init__(self, spin: float = 80e-6) -> None:
        self._spin = spin
        self._margin = 0
        self._start = 0
        self._period = 0.0

    def start(self, period: float) -> None:
        """Set the time of tick 0 to now."""
        self._period = period * 1e9
        self._margin = int(min(self._spin, period / 4) * 1e9)
        self._start = time.monotonic_ns()

    def wait(self, tick: int) -> float:
        """Sleep, then spin until the deadline of `tick`; return the lateness (s)."""
        due = self._start + round(tick * self._period)
        now = time.monotonic_ns()
        asleep = due - now - self._margin
        if asleep > 0:
            time.sleep(asleep * 1e-9)
        while True:
            now = time.monotonic_ns()
            if now >= due:
                return (now - due) * 1e-9
