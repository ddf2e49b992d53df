"""The links that a plant server speaks: for each a device's side, built around a plant."""

from __future__ import annotations

import importlib
import inspect
from typing import TYPE_CHECKING, Any, Protocol, cast

from rtcomp.errors import ConfigError, nearest

if TYPE_CHECKING:
    from rtcomp.stage.stage import Stage
    from rtcomp_drivers.board import Plant

LINKS = {
    "serial": "rtcomp_drivers.board:board_side",
    "odrive-can": "rtcomp_drivers.odrive_axis:odrive_side",
    "cia402": "rtcomp_drivers.cia402_axis:cia402_side",
}
"""Link to what builds its device's side, ``module:function(plant, stage)``; imported when asked for."""


class DeviceSide(Protocol):
    """What stands behind the port: bytes and time in, bytes out, a plant that it moves, no clock."""

    time: float
    """s, the device's clock: how far the plant has been run."""
    lagging: bool
    """Set by whoever runs it where it cannot keep up with real time."""

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes that arrived at `now` (s); return the answer."""

    def run_until(self, now: float) -> bytes:
        """Let time pass to `now` (s); return what is sent unasked."""

    def shut_down(self, now: float) -> None:
        """Zero the output because the device itself ends."""

    def summary(self) -> dict[str, Any]:
        """Return what happened: counters, and each time at which the output went to zero."""


def build(link: str, plant: Plant, stage: Stage, watchdog: float | None = None) -> DeviceSide:
    """Build the device's side of `link`; raise ConfigError where there is none.

    `watchdog` (s) is for drives on which it is set beforehand; a board's is set by the host that arms it.
    """
    if link not in LINKS:
        raise ConfigError(f"plant server: unknown link {link!r}; {nearest(link, LINKS)}")
    module, _, function = LINKS[link].partition(":")
    try:
        builder = getattr(importlib.import_module(module), function)
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        raise ConfigError(f"plant server: this version does not serve the link {link!r}") from None
    if watchdog is None:
        return cast(DeviceSide, builder(plant, stage))
    if "watchdog" not in inspect.signature(builder).parameters:
        raise ConfigError(f"plant server: on the link {link!r} the host sets the watchdog, not the device")
    return cast(DeviceSide, builder(plant, stage, watchdog=watchdog))
