"""What tripped, in one line with the remedy."""

from __future__ import annotations

import math

from rtcomp.errors import DeviceError, DeviceTimeoutError, EmergencyStopError, LimitError, RtcompError
from rtcomp.loop import layout as at
from rtcomp.loop.tick import Tick

STOPPED_BY = {1: "asked for", 2: "the stop file", 3: "a key"}
"""What the number in the ring's header says of who asked for an emergency stop."""


def trip(tick: Tick, number: int, position: float, asked: int = 0) -> RtcompError:
    """Return the error for the fault that tick `number` found at `position` (m).

    `asked` is who asked for an emergency stop, as the ring's header has it.
    """
    s = tick.settings
    where = f"at tick {number} ({number * s[at.PERIOD]:.4g} s)"
    zero = "stopped at zero volts"
    kind, what = _SAYS[tick.fault]
    numbers = {
        "position": f"{position:g}",
        "low": f"{s[at.TRAVEL_LOW]:g}",
        "high": f"{s[at.TRAVEL_HIGH]:g}",
        "speed": f"{s[at.SPEED_LIMIT]:g}",
        "jump": f"{s[at.JUMP_LIMIT]:g}",
        "volts": f"{tick.state[at.HISTORY]:.3g}",
        "stuck": f"{1e3 * s[at.PERIOD] * _or(s[at.STUCK_TICKS]):.3g}",
        "ran": f"{1e3 * s[at.PERIOD] * s[at.SIGN_TICKS]:.3g}",
        "age": f"{1e3 * s[at.PERIOD] * tick.state[at.AGE]:.3g}",
        "repeated": f"{tick.state[at.REPEATED_RUN]:.0f}",
        "lost": f"{_or(s[at.SLOTS_LOST]):.0f}",
        "by": STOPPED_BY.get(asked, "the device itself"),
    }
    says, _, remedy = what.partition("; ")
    return kind(f"{says.format(**numbers)} {where}; {zero}: {remedy}")


def _or(value: float) -> float:
    return value if math.isfinite(value) else 0.0


_SAYS: dict[int, tuple[type[RtcompError], str]] = {
    at.NOT_FINITE: (
        DeviceError,
        "the device reported the position {position}; check the sensor, and the driver's units",
    ),
    at.TRAVEL: (
        LimitError,
        "position {position} m left the travel [{low}, {high}] m; check the sign of the feedback, or widen "
        "limits.travel",
    ),
    at.SPEED: (
        LimitError,
        "position moved to {position} m faster than limits.speed = {speed} m/s; check the encoder, or raise "
        "limits.speed",
    ),
    at.JUMP: (
        LimitError,
        "position jumped to {position} m, by more than limits.jump = {jump} m from where it was going; check "
        "the encoder, its index and its cable, or raise limits.jump",
    ),
    at.STUCK: (
        LimitError,
        "the axis did not move for {stuck} ms while driven with {volts} V; check motor, supply, brake and "
        "encoder, or raise limits.voltage or limits.stuck",
    ),
    at.SIGN: (
        LimitError,
        "the axis ran against its drive ({volts} V) for {ran} ms, ever faster; swap the motor's leads or "
        "turn the sensor's direction round",
    ),
    at.SILENT: (
        DeviceTimeoutError,
        "no new sample for {age} ms, more than limits.age; is the device still powered and connected?",
    ),
    at.FROZEN: (
        DeviceError,
        "the device sent {repeated} samples in a row that it calls new but whose count or time stands still; "
        "restart the device",
    ),
    at.NO_POSITION: (
        DeviceError,
        "the device says that its position must not be used; find the beam or the index again (home the "
        "axis), or raise limits.invalid",
    ),
    at.COMMAND: (
        LimitError,
        "the command is no number; look at the model, the gains and the reference there",
    ),
    at.OVERRUN: (
        DeviceError,
        "{lost} slots lost; lower the rate, or see `rtcomp doctor` for what holds up this machine",
    ),
    at.ESTOP: (
        EmergencyStopError,
        "emergency stop by {by}; see that the axis may move, release the stop, then start again",
    ),
}
