"""The one device: what the loop knows of everything between itself and the metal."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

OK = 0
STALE = 1
"""Status of a sample that is not new: the device did not answer in time and an older one is reused."""
INVALID = 2
"""Status of a sample whose position must not be used."""
ESTOP = 3
"""Status of a sample by which a device says that its own emergency stop is pressed: the loop ends latched."""


class EndOfRun(Exception):  # noqa: N818 - no error: a recording that plays the stage has been played
    """Raised by `exchange` where the device has no more samples to give; the run ends well."""


class Sample(NamedTuple):
    """What a device says in one exchange."""

    position: float
    """m (rad), measured."""
    time: float
    """s, the device's own clock at the measurement."""
    sequence: int
    """Counts the device's samples; a gap means some were lost."""
    status: int = OK


@runtime_checkable
class Device(Protocol):
    """A positioning axis, simulated or real.

    `exchange(volts)` hands over the command that is valid from now on and returns the position measured
    now, before that command takes effect. It is called once a tick. A simulated device in virtual time
    advances by one period with the command handed over, then measures.
    """

    delay_ticks: int
    """Whole ticks from a command's computation until it takes effect: 0 in ideal simulation; 1 where a
    command computed from one exchange travels with the next (every real link)."""

    def open(self) -> None:
        """Take the device and prepare it; raise DeviceError where it cannot be had."""

    def exchange(self, volts: float) -> Sample:
        """Hand over a command (V) and return the newest sample; raise DeviceError when the device is gone."""

    def close(self) -> None:
        """Send zero volts and let go. Safe to call twice, and after a failure."""


@runtime_checkable
class Armable(Protocol):
    """What a device has besides that can be looked at before it is armed. Real links have it."""

    def look(self) -> Sample:
        """Return a new sample; the device, not armed, puts out nothing. Raises DeviceError."""

    def arm(self) -> None:
        """Arm the device: from now on it acts on commands and its watchdog runs. Raises DeviceError."""
