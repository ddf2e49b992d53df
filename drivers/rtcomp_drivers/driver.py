"""What a driver is: settings that are checked, a bench that it is told of, and a device."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

from pydantic import BaseModel, ConfigDict

from rtcomp.errors import DeviceError, LimitError
from rtcomp.loop.device import Sample

if TYPE_CHECKING:
    from rtcomp.kernels import Floats
    from rtcomp.stage.stage import Stage


class Columns(Protocol):
    """A recording, as far as drivers need it: its columns by name, rows equally spaced."""

    @property
    def columns(self) -> Mapping[str, Floats]:
        """One-dimensional float64 arrays of equal length by the names of FORMATS.md."""


@dataclass(frozen=True)
class Bench:
    """What a driver may need to know of the run that it serves."""

    stage: Stage | None = None
    """What the run believes of the axis; simulated drivers simulate it."""
    period: float = 1e-3
    """s, from one exchange to the next."""
    seed: int = 0
    """For noise, where the driver makes any."""
    start: float = 0.0
    """m (rad), where a simulated stage stands at first."""
    substeps: float = 1.0
    """Multiplies the integration steps of a simulated stage."""
    realtime: bool = False
    """Whether exchanges come by the wall clock."""
    recording: Columns | None = None
    """The recording to play, for drivers that play one."""


class DriverSettings(BaseModel):
    """Base of a driver's settings: the configuration's section ``device``. Unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    driver: str
    """The driver's name."""


class Driver:
    """Base of drivers: a Device that is built from its settings and the bench.

    Subclasses set `name`, `Settings` and `delay_ticks` and write `open`, `exchange` and `close`; what can be
    looked at before it is armed has `look` and `arm` as well (`rtcomp.loop.device.Armable`). Also a
    context manager: leaving it closes the device.
    """

    name: ClassVar[str]
    """The name in configurations and messages."""
    Settings: ClassVar[type[DriverSettings]]
    hardware: bool = True
    """Whether something real moves: hardware is armed only where it was asked for. False for simulations, and
    for links whose other side, once open, says that it is one."""

    def __init__(self, settings: Any, bench: Bench) -> None:
        self.settings = settings
        self.bench = bench
        self.delay_ticks = 0
        """See Device."""
        self.counters: dict[str, int] = {}
        """What went other than it should, counted; may be empty."""
        self.remarks: list[str] = []
        """What a person should know about this device before relying on it; one line each."""
        self.who = ""
        """What is there, for messages to people, once open."""

    def open(self) -> None:
        """Take the device; does nothing where it is open already. Raises DeviceError."""
        raise NotImplementedError

    def exchange(self, volts: float) -> Sample:
        """Hand over a command (V), return the newest sample; see Device. Raises DeviceError, LimitError."""
        raise NotImplementedError

    def close(self) -> None:
        """Send zero volts and let go; does nothing where it is closed already."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def not_open(self) -> DeviceError:
        """Make the error for an exchange with a device that is not open."""
        return DeviceError(f"{self.name}: exchange while the device is not open; call open() first")


def check_volts(name: str, volts: float) -> None:
    """Raise LimitError where a command is NaN or infinite, so that it never reaches an output."""
    if not math.isfinite(volts):
        raise LimitError(f"{name}: command is {volts} V; it must be a finite number")


def says_of(driver: type[Any]) -> str:
    """Return the first line of a driver's docstring."""
    return (driver.__doc__ or "").strip().split("\n")[0]
