"""Faults on purpose: a device and a clock that go wrong at a given tick, around any real ones.

Nothing of the loop knows of this. What goes wrong is a `Fault`: a kind of `KINDS`, the exchange at which it
begins, how many it lasts, and a size where the kind has one.
"""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

from rtcomp.errors import DeviceError
from rtcomp.loop.clock import Clock
from rtcomp.loop.device import ESTOP, INVALID, OK, STALE, Armable, Device, Sample

KINDS = {
    "no reply": "no sample comes; the newest one is handed out again, marked stale",
    "frozen": "the newest sample is handed out again and again as a new one",
    "reordered": "the sample before the newest comes after it",
    "not a number": "the position is NaN, an infinity or a denormal number: the size",
    "jump": "the position is off by the size (m) for as long as it lasts",
    "stuck": "the position stands still; count and time run on",
    "sign flipped": "the position runs the other way from where it was",
    "beam lost": "the device says that its position must not be used",
    "wrap": "the count of samples wraps round to 0 there; the size is the power of two",
    "device e-stop": "the device says that its emergency stop is pressed",
    "device error": "the driver raises what a device with an error of its own makes it raise",
    "unplug": "the operating system says that the port has gone",
    "late": "the clock wakes late, by the size (s)",
    "call": "something else happens at that exchange",
}
"""Every kind, with what it does."""


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong: `kind` from exchange (or tick) `at` on, for `ticks` of them."""

    kind: str
    at: int
    ticks: float = math.inf
    size: float = 0.0
    call: Callable[[], None] | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"no kind of fault is named {self.kind!r}; known are {', '.join(KINDS)}")

    def holds(self, number: int) -> bool:
        """Whether it is there at exchange, or tick, `number`."""
        return self.at <= number < self.at + self.ticks


class FaultyDevice:
    """A device around another one that goes wrong as it is told. Every command still reaches the inner one,
    but where the port has gone.
    """

    def __init__(self, inner: Device, faults: Sequence[Fault]) -> None:
        self.inner = inner
        self.faults = list(faults)
        self.delay_ticks = inner.delay_ticks
        self.exchanges = 0
        self._newest: Sample | None = None
        self._before: Sample | None = None
        self._held: dict[int, float] = {}

    def open(self) -> None:
        """Open the inner device."""
        self.inner.open()

    def close(self) -> None:
        """Close the inner device."""
        self.inner.close()

    def exchange(self, volts: float) -> Sample:
        """Exchange with the inner device, then spoil what came of it."""
        number, self.exchanges = self.exchanges, self.exchanges + 1
        now = [fault for fault in self.faults if fault.holds(number) or fault.kind == "wrap"]
        for fault in now:
            if fault.kind == "unplug":
                raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
        sample = self.inner.exchange(volts)
        for fault in now:
            if fault.kind == "device error":
                raise DeviceError(f"the device reports error 0x{int(fault.size):04x}; see its manual")
            sample = self._spoilt(sample, fault, number)
        self._before, self._newest = self._newest, sample
        return sample

    def _spoilt(self, sample: Sample, fault: Fault, number: int) -> Sample:
        newest = self._newest or sample
        x = sample.position
        match fault.kind:
            case "no reply":
                return newest._replace(status=STALE)
            case "frozen":
                return newest._replace(status=OK)
            case "reordered":
                return (self._before or newest)._replace(status=OK)
            case "not a number":
                return sample._replace(position=fault.size)
            case "jump":
                return sample._replace(position=x + fault.size)
            case "stuck":
                return sample._replace(position=self._held.setdefault(id(fault), x))
            case "sign flipped":
                return sample._replace(position=2.0 * self._held.setdefault(id(fault), newest.position) - x)
            case "beam lost":
                return sample._replace(status=INVALID)
            case "device e-stop":
                return sample._replace(status=ESTOP)
            case "wrap":
                return sample._replace(sequence=int((sample.sequence - fault.at - 1) % fault.size))
            case "call":
                assert fault.call is not None
                fault.call()
        return sample


class FaultyLink(FaultyDevice):
    """The same around a device that can be looked at before it is armed, as every real link can."""

    def look(self) -> Sample:
        """Look at the inner device, which is as it is."""
        return cast(Armable, self.inner).look()

    def arm(self) -> None:
        """Arm the inner device."""
        cast(Armable, self.inner).arm()


class FaultyClock:
    """A clock around another one that wakes late as it is told; what was missed is made up for."""

    def __init__(self, inner: Clock, faults: Sequence[Fault]) -> None:
        self.inner = inner
        self.late = [fault for fault in faults if fault.kind == "late"]

    def start(self, period: float) -> None:
        """Start the inner clock."""
        self.inner.start(period)

    def wait(self, tick: int) -> float:
        """Return the lateness (s) at `tick`."""
        return self.inner.wait(tick) + sum(fault.size for fault in self.late if fault.holds(tick))
