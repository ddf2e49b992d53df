"""A dead man's rule: hardware moves only when somebody asked for it, on a machine that keeps deadlines."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rtcomp.errors import NotArmedError
from rtcomp.loop.realtime import realtime_process

if TYPE_CHECKING:
    from rtcomp.control.references import Reference
    from rtcomp.jobs.configuration import Configuration
    from rtcomp.loop.device import Device


@dataclass(frozen=True)
class Arming:
    """What whoever starts a run has asked for."""

    armed: bool = False
    """Hardware may move."""
    allow_non_rt: bool = False
    """Also where this machine grants neither SCHED_FIFO nor locked memory."""
    countdown: Callable[[], None] | None = None
    """Called once all is in order, before the first arming; may raise to stop it."""


def is_hardware(device: Device) -> bool:
    """Tell whether something real moves behind an open device. One that does not say is taken to."""
    return bool(getattr(device, "hardware", True))


def permit(config: Configuration, device: Device, start: float, reference: Reference) -> None:
    """Raise NotArmedError where `device`, which was looked at and stands at `start` (m), may not be driven.

    Simulations, replays, plant servers and firmware on the host may always be.
    """
    if not is_hardware(device):
        return
    asked = config.arming
    who = getattr(device, "who", None) or f"the device of the driver {config.run.device.get('driver')}"
    said = "".join(f"; {remark}" for remark in getattr(device, "remarks", ()))
    if not asked.armed:
        before = ", after reversals that die out" if config.run.relax is not None else ""
        raise NotArmedError(
            f"{who} is ready and stands at {start:.6g} {_unit(config)}; it would follow its reference for "
            f"{reference.duration:g} s within {config.voltage_limit:g} V{before}{said}; nothing was armed: "
            "see that the axis may move, then give --armed"
        )
    with realtime_process() as granted:
        missing = not_real_time(granted)
    if missing and not asked.allow_non_rt:
        raise NotArmedError(
            f"{who}: this machine does not grant {' and '.join(missing)}, so deadlines may be missed by "
            "milliseconds; nothing was armed: `rtcomp doctor` says what mends it, --allow-non-rt does without"
        )
    if asked.countdown is not None:
        asked.countdown()


def not_real_time(granted: Mapping[str, str]) -> list[str]:
    """Return what of a real-time class and locked memory is not in force."""
    missing = []
    if not any(name in granted.get("scheduling_class", "") for name in ("FIFO", "RR", "DEADLINE")):
        missing.append("SCHED_FIFO")
    if granted.get("locked_memory", "unknown").startswith(("0 ", "unknown", "no")):
        missing.append("locked memory")
    return missing


def _unit(config: Configuration) -> str:
    return "rad" if config.stage.axis == "rotary" else "m"
