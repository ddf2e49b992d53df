"""ODrive's CANSimple protocol, 0.6 and 0.5.6: what frames mean. Pure: identifiers and data bytes, no bus.

An identifier is the node's number times 32 plus the command. All numbers are little-endian, every frame has
the length that ODrive's DBC gives it, unused bytes are 0; a frame of any other length is none of the
protocol's. Source: ODrive's documentation, page CAN Protocol, and odrive-cansimple-0.6.10.dbc, -0.5.6.dbc.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

MOST_NODE = 62
"""63 means that a node has no number yet."""
DIALECTS = ("0.6", "0.5.6")


class Command(IntEnum):
    """The commands that are spoken here; ODrive has more."""

    VERSION = 0x00
    """0.6 only; asked for with a remote frame, as all that begin with Get in the DBC."""
    HEARTBEAT = 0x01
    ESTOP = 0x02
    ERROR = 0x03
    """0.6: active errors and the reason of disarming. 0.5.6: the motor's error."""
    AXIS_STATE = 0x07
    ENCODER_ESTIMATES = 0x09
    CONTROLLER_MODE = 0x0B
    INPUT_POS = 0x0C
    INPUT_VEL = 0x0D
    INPUT_TORQUE = 0x0E
    LIMITS = 0x0F
    REBOOT = 0x16
    CLEAR_ERRORS = 0x18


FROM_A_MASTER = frozenset(
    (
        Command.AXIS_STATE, Command.CONTROLLER_MODE, Command.INPUT_POS, Command.INPUT_VEL,
        Command.INPUT_TORQUE, Command.LIMITS, Command.REBOOT, Command.CLEAR_ERRORS,
    )
)  # fmt: skip
"""What only a master sends as a data frame."""

IDLE, CLOSED_LOOP = 1, 8
TORQUE_CONTROL, PASSTHROUGH = 1, 1

STATES: Mapping[int, str] = {
    0: "UNDEFINED", 1: "IDLE", 2: "STARTUP_SEQUENCE", 3: "FULL_CALIBRATION_SEQUENCE", 4: "MOTOR_CALIBRATION",
    5: "SENSORLESS_CONTROL", 6: "ENCODER_INDEX_SEARCH", 7: "ENCODER_OFFSET_CALIBRATION",
    8: "CLOSED_LOOP_CONTROL", 9: "LOCKIN_SPIN", 10: "ENCODER_DIR_FIND", 11: "HOMING",
    12: "ENCODER_HALL_POLARITY_CALIBRATION", 13: "ENCODER_HALL_PHASE_CALIBRATION",
    14: "ANTICOGGING_CALIBRATION",
}  # fmt: skip
INVALID_STATE_RESULT = 13
"""Result of a procedure that the axis cannot begin in its state."""

ERRORS: Mapping[str, Mapping[int, str]] = {
    "0.6": {
        0x1: "INITIALIZING", 0x2: "SYSTEM_LEVEL", 0x4: "TIMING_ERROR", 0x8: "MISSING_ESTIMATE",
        0x10: "BAD_CONFIG", 0x20: "DRV_FAULT", 0x40: "MISSING_INPUT", 0x100: "DC_BUS_OVER_VOLTAGE",
        0x200: "DC_BUS_UNDER_VOLTAGE", 0x400: "DC_BUS_OVER_CURRENT", 0x800: "DC_BUS_OVER_REGEN_CURRENT",
        0x1000: "CURRENT_LIMIT_VIOLATION", 0x2000: "MOTOR_OVER_TEMP", 0x4000: "INVERTER_OVER_TEMP",
        0x8000: "VELOCITY_LIMIT_VIOLATION", 0x10000: "POSITION_LIMIT_VIOLATION",
        0x1000000: "WATCHDOG_TIMER_EXPIRED", 0x2000000: "ESTOP_REQUESTED", 0x4000000: "SPINOUT_DETECTED",
        0x8000000: "BRAKE_RESISTOR_DISARMED", 0x10000000: "THERMISTOR_DISCONNECTED",
        0x40000000: "CALIBRATION_ERROR",
    },
    "0.5.6": {
        0x1: "INVALID_STATE", 0x40: "MOTOR_FAILED", 0x80: "SENSORLESS_ESTIMATOR_FAILED",
        0x100: "ENCODER_FAILED", 0x200: "CONTROLLER_FAILED", 0x800: "WATCHDOG_TIMER_EXPIRED",
        0x1000: "MIN_ENDSTOP_PRESSED", 0x2000: "MAX_ENDSTOP_PRESSED", 0x4000: "ESTOP_REQUESTED",
        0x20000: "HOMING_WITHOUT_ENDSTOP", 0x40000: "OVER_TEMP", 0x80000: "UNKNOWN_POSITION",
    },
}  # fmt: skip
"""Bits of the axis' error by dialect."""
_PARTS = ("motor", "encoder", "controller")

_HEARTBEAT = struct.Struct("<IBBBB")
_TWO_FLOATS = struct.Struct("<ff")
_ONE_FLOAT = struct.Struct("<f4x")
_TWO_NUMBERS = struct.Struct("<II")
_ONE_NUMBER = struct.Struct("<I4x")
_VERSION = struct.Struct("<8B")
_FULL = 8


class Heartbeat(NamedTuple):
    """What an axis says of itself, ten times a second unless set otherwise."""

    error: int
    state: int
    result: int = 0
    """0.6: how the last procedure ended."""
    parts: tuple[str, ...] = ()
    """0.5.6: which of motor, encoder and controller have errors of their own."""
    done: bool = False
    """Whether a trajectory has reached its end."""


STAND_IN = (0, 0, 0)
"""Hardware version of a simulated axis: no product has it."""


class Version(NamedTuple):
    """Answer to VERSION."""

    protocol: int
    hardware: tuple[int, int, int]
    firmware: tuple[int, int, int]
    unreleased: int = 0


def identifier(node: int, command: int) -> int:
    """Return the identifier of a node's frame."""
    return node << 5 | command


def error_bit(name: str, dialect: str) -> int:
    """Return the bit of an axis error by its name."""
    return next(bit for bit, known in ERRORS[dialect].items() if known == name)


def error_names(error: int, dialect: str) -> str:
    """Return the names of the bits of an axis error, and in hexadecimal those that have none."""
    known = ERRORS[dialect]
    names = [name for bit, name in known.items() if error & bit]
    rest = error & ~sum(known)
    if rest:
        names.append(f"unknown 0x{rest:X}")
    return ", ".join(names) or "none"


def encode_heartbeat(beat: Heartbeat, dialect: str) -> bytes:
    """Return the data of a HEARTBEAT."""
    if dialect == "0.6":
        return _HEARTBEAT.pack(beat.error, beat.state, beat.result, beat.done, 0)
    motor, encoder, controller = (part in beat.parts for part in _PARTS)
    return _HEARTBEAT.pack(beat.error, beat.state, motor, encoder, controller | beat.done << 7)


def decode_heartbeat(data: bytes | bytearray, dialect: str) -> Heartbeat | None:
    """Return what a HEARTBEAT says; None where it is none."""
    if len(data) != _FULL:
        return None
    error, state, b5, b6, b7 = _HEARTBEAT.unpack(data)
    if dialect == "0.6":
        return Heartbeat(error, state, b5, (), bool(b6 & 1))
    parts = tuple(part for part, byte in zip(_PARTS, (b5, b6, b7), strict=True) if byte & 1)
    return Heartbeat(error, state, 0, parts, bool(b7 & 0x80))


def encode_version(version: Version) -> bytes:
    """Return the data of a VERSION."""
    return _VERSION.pack(version.protocol, *version.hardware, *version.firmware, version.unreleased)


def decode_version(data: bytes | bytearray) -> Version | None:
    """Return what a VERSION says; None where it is none."""
    if len(data) != _FULL:
        return None
    protocol, h1, h2, h3, f1, f2, f3, unreleased = _VERSION.unpack(data)
    return Version(protocol, (h1, h2, h3), (f1, f2, f3), unreleased)


def encode_estimates(turns: float, turns_per_s: float) -> bytes:
    """Return the data of ENCODER_ESTIMATES: position (turns) and speed (turns/s), single precision."""
    return _TWO_FLOATS.pack(turns, turns_per_s)


def decode_estimates(data: bytes | bytearray) -> tuple[float, float] | None:
    """Return position (turns) and speed (turns/s); None where the frame holds none."""
    return _TWO_FLOATS.unpack(data) if len(data) == _FULL else None


def encode_state(state: int) -> bytes:
    """Return the data of AXIS_STATE."""
    return _ONE_NUMBER.pack(state)


def encode_mode(control: int = TORQUE_CONTROL, input_mode: int = PASSTHROUGH) -> bytes:
    """Return the data of CONTROLLER_MODE."""
    return _TWO_NUMBERS.pack(control, input_mode)


def encode_torque(torque: float) -> bytes:
    """Return the data of INPUT_TORQUE (Nm, single precision)."""
    return _ONE_FLOAT.pack(torque)


def encode_limits(turns_per_s: float, amperes: float) -> bytes:
    """Return the data of LIMITS."""
    return _TWO_FLOATS.pack(turns_per_s, amperes)


def encode_clear(dialect: str) -> bytes:
    """Return the data of CLEAR_ERRORS: since 0.6 a byte that asks a light to blink, or not."""
    return b"\0" if dialect == "0.6" else b""


def encode_error(active: int, reason: int) -> bytes:
    """Return the data of ERROR as 0.6 has it: active errors, and why the axis was disarmed."""
    return _TWO_NUMBERS.pack(active, reason)


def decode_two_numbers(data: bytes | bytearray) -> tuple[int, int] | None:
    """Return the two numbers of ERROR (0.6) or CONTROLLER_MODE; None where there are none."""
    return _TWO_NUMBERS.unpack(data) if len(data) == _FULL else None


def decode_number(data: bytes | bytearray) -> int | None:
    """Return the number of AXIS_STATE; None where there is none."""
    return int(_ONE_NUMBER.unpack(data)[0]) if len(data) == _FULL else None


def decode_torque(data: bytes | bytearray) -> float | None:
    """Return the torque (Nm) of INPUT_TORQUE; None where there is none."""
    return float(_ONE_FLOAT.unpack(data)[0]) if len(data) == _FULL else None
