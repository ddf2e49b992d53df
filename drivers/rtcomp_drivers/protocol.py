"""The serial protocol's codec: messages to frames and back. Pure: no ports, no clocks.

A frame is ``COBS(payload + CRC-32) 0x00``, little-endian throughout; drivers/README.md specifies every
byte. COBS (Cheshire and Baker 1999, IEEE/ACM Trans. Networking 7(2)) takes the zeros out of the data, so
that a zero on the line is always the end of a frame: a receiver that joins late, or has lost bytes, is
back in step at the next zero. The CRC is that of Ethernet and zlib.
"""

from __future__ import annotations

import struct
import zlib
from typing import NamedTuple

VERSION = 1
"""Protocol version; the second byte of HELLO and INFO in every version."""

MAX_PAYLOAD = 246
"""Most bytes of payload, without CRC: with it no run between zeros reaches 254, so that COBS code 0xFF never
occurs."""
MAX_FRAME = MAX_PAYLOAD + 4 + 1
"""Most bytes on the line before a frame's closing zero."""
MAX_TEXT = 64
"""Most bytes (UTF-8) of the texts in INFO and FAULT."""

DISARMED, ARMED, FAULT = 0, 1, 2
"""States of a board."""
STATES = {DISARMED: "DISARMED", ARMED: "ARMED", FAULT: "FAULT"}

LINEAR, ROTARY = 0, 1
AXES = {LINEAR: "linear", ROTARY: "rotary"}
"""Kinds of axis; positions are in m on a linear, in rad on a rotary axis."""

NO_FAULT, WATCHDOG, LINK, SENSOR, DRIVE, OVERRUN, ESTOP = 0, 1, 2, 3, 4, 5, 6
FAULTS = {
    NO_FAULT: "no fault",
    WATCHDOG: "watchdog: no command came in time",
    LINK: "link: too many bad frames",
    SENSOR: "position sensor",
    DRIVE: "drive or amplifier",
    OVERRUN: "the board missed its own deadlines",
    ESTOP: "emergency stop",
}
"""Reasons for the state FAULT."""

ACCEPTED, WRONG_STATE, BAD_PARAMETER = 0, 1, 2
RESULTS = {ACCEPTED: "accepted", WRONG_STATE: "not in this state", BAD_PARAMETER: "parameter out of range"}
"""Results in a reply to ARM, DISARM and CLEAR."""

POSITION_INVALID, CLAMPED, IGNORED, LAGGING = 1, 2, 4, 8
"""Flags of a sample: the position must not be used; this command was clamped to the voltage limit; this
command was not acted on, the board is not armed; the board runs behind its own clock."""


class Hello(NamedTuple):
    """Host: who are you? Begins a session; asked again until answered."""

    tag: int
    version: int = VERSION


class Arm(NamedTuple):
    """Host: from now on act on commands, and fault where none comes within `watchdog_ms`."""

    tag: int
    watchdog_ms: int
    voltage_limit_uv: int
    period_us: int


class Command(NamedTuple):
    """Host: put out `voltage_uv` (microvolts) from now on, and send a sample taken just before."""

    sequence: int
    voltage_uv: int


class Disarm(NamedTuple):
    """Host: zero the output and act on no more commands."""

    tag: int


class Clear(NamedTuple):
    """Host: leave the state FAULT for DISARMED."""

    tag: int


class Info(NamedTuple):
    """Board: answer to HELLO."""

    tag: int
    version: int
    axis: int
    state: int
    fault: int
    max_rate_hz: int
    voltage_limit_uv: int
    count_size: float
    """m (rad) per position count."""
    text: str
    """What the board and its firmware call themselves."""


class OtherVersion(NamedTuple):
    """Board: an INFO in a protocol version that this codec does not speak."""

    tag: int
    version: int


class Reply(NamedTuple):
    """Board: answer to ARM, DISARM and CLEAR."""

    tag: int
    result: int
    state: int
    fault: int


class Measured(NamedTuple):
    """Board: the SAMPLE that answers COMMAND, taken before the command took effect."""

    sequence: int
    """The command's."""
    time_us: int
    """The board's own clock."""
    position: int
    """counts"""
    output_uv: int
    """What the board put out when it took the sample."""
    flags: int
    state: int


class Fault(NamedTuple):
    """Board: sent once by itself when it enters the state FAULT."""

    fault: int
    time_us: int
    text: str


Message = Hello | Arm | Command | Disarm | Clear | Info | OtherVersion | Reply | Measured | Fault

_HELLO, _ARM, _COMMAND, _DISARM, _CLEAR = 0x01, 0x02, 0x03, 0x04, 0x05
_INFO, _REPLY, _SAMPLE, _FAULT = 0x81, 0x82, 0x83, 0x84

# HELLO and INFO begin with type, version, tag in every version, so that versions can tell each other apart.
_HELLO_FORM = struct.Struct("<BBB")
_ARM_FORM = struct.Struct("<BBHII")
_COMMAND_FORM = struct.Struct("<BIi")
_TAG_FORM = struct.Struct("<BB")
_INFO_FORM = struct.Struct("<BBBBBBIId")
_REPLY_FORM = struct.Struct("<BBBBB")
_SAMPLE_FORM = struct.Struct("<BIQqiBB")
_FAULT_FORM = struct.Struct("<BBQ")

_BYTE = [bytes([i]) for i in range(256)]


def stuff(data: bytes) -> bytes:
    """Return `data` COBS-encoded, without the delimiter; no run between zeros may reach 254 bytes."""
    return b"".join([_BYTE[len(run) + 1] + run for run in data.split(b"\0")])


def unstuff(data: bytes) -> bytes | None:
    """Return `data`, COBS-encoded by `stuff`, decoded; None where it is not such."""
    runs, place, size = [], 0, len(data)
    while place < size:
        code = data[place]
        if code in (0, 0xFF) or place + code > size:
            return None
        runs.append(data[place + 1 : place + code])
        place += code
    return b"\0".join(runs) if runs else None


def frame(payload: bytes) -> bytes:
    """Return `payload` as it goes over the line: CRC added, COBS-encoded, closed by a zero."""
    if not 0 < len(payload) <= MAX_PAYLOAD:
        raise ValueError(f"payload has {len(payload)} bytes; allowed is [1, {MAX_PAYLOAD}]")
    return stuff(payload + zlib.crc32(payload).to_bytes(4, "little")) + b"\0"


def payload_of(encoded: bytes) -> bytes | None:
    """Return the payload of a frame (without its zero), or None where coding or CRC is wrong."""
    data = unstuff(encoded)
    if data is None or len(data) < 5 or zlib.crc32(data[:-4]) != int.from_bytes(data[-4:], "little"):
        return None
    return data[:-4]


def encode(message: Message) -> bytes:
    """Return the frame of a message; ValueError where a field does not fit its place on the line."""
    try:
        return frame(_pack(message))
    except struct.error as error:
        raise ValueError(f"{message} does not fit the protocol: {error}") from error


def encode_command(sequence: int, voltage_uv: int) -> bytes:
    """Return the frame of a COMMAND; the same as `encode`, for the tick."""
    payload = _COMMAND_FORM.pack(_COMMAND, sequence, voltage_uv)
    return stuff(payload + zlib.crc32(payload).to_bytes(4, "little")) + b"\0"


def _pack(message: Message) -> bytes:
    match message:
        case Command():
            return _COMMAND_FORM.pack(_COMMAND, *message)
        case Measured():
            return _SAMPLE_FORM.pack(_SAMPLE, *message)
        case Hello(tag, version):
            return _HELLO_FORM.pack(_HELLO, version, tag)
        case Arm():
            return _ARM_FORM.pack(_ARM, *message)
        case Disarm(tag):
            return _TAG_FORM.pack(_DISARM, tag)
        case Clear(tag):
            return _TAG_FORM.pack(_CLEAR, tag)
        case Info(tag, version, axis, state, fault, rate, limit, size, text):
            return _INFO_FORM.pack(_INFO, version, tag, axis, state, fault, rate, limit, size) + _text(text)
        case OtherVersion(tag, version):
            return _HELLO_FORM.pack(_INFO, version, tag)
        case Reply():
            return _REPLY_FORM.pack(_REPLY, *message)
        case Fault(fault, time_us, text):
            return _FAULT_FORM.pack(_FAULT, fault, time_us) + _text(text)


def _text(text: str) -> bytes:
    data = text.encode()
    if len(data) > MAX_TEXT:
        raise ValueError(f"text has {len(data)} bytes; allowed is [0, {MAX_TEXT}]")
    return data


def parse(payload: bytes) -> Message | None:
    """Return the message in a payload whose CRC was right, or None for a type or length not known."""
    try:
        kind = payload[0]
        if kind == _SAMPLE:
            return Measured(*_SAMPLE_FORM.unpack(payload)[1:])
        if kind == _COMMAND:
            return Command(*_COMMAND_FORM.unpack(payload)[1:])
        return _parse_rare(kind, payload)
    except (struct.error, UnicodeDecodeError):
        return None


def _parse_rare(kind: int, payload: bytes) -> Message | None:
    if kind == _HELLO:  # a later version may be longer; what begins it never changes
        _, version, tag = _HELLO_FORM.unpack_from(payload)
        return Hello(tag, version)
    if kind == _ARM:
        return Arm(*_ARM_FORM.unpack(payload)[1:])
    if kind == _DISARM:
        return Disarm(_TAG_FORM.unpack(payload)[1])
    if kind == _CLEAR:
        return Clear(_TAG_FORM.unpack(payload)[1])
    if kind == _INFO:
        _, version, tag = _HELLO_FORM.unpack_from(payload)
        if version != VERSION:
            return OtherVersion(tag, version)
        _, _, _, axis, state, fault, rate, limit, size = _INFO_FORM.unpack_from(payload)
        text = payload[_INFO_FORM.size :].decode()
        return Info(tag, version, axis, state, fault, rate, limit, size, text)
    if kind == _REPLY:
        return Reply(*_REPLY_FORM.unpack(payload)[1:])
    if kind == _FAULT:
        _, fault, time_us = _FAULT_FORM.unpack_from(payload)
        return Fault(fault, time_us, payload[_FAULT_FORM.size :].decode())
    return None


class Decoder:
    """Takes bytes as they come and returns the messages completed by them.

    Whatever comes before a zero and is not a good frame is dropped and counted; at the latest the second
    good frame after any disturbance is decoded again (the first may be merged with what disturbed).
    """

    def __init__(self) -> None:
        self.good = 0
        """Frames with a right CRC and a known type."""
        self.bad = 0
        """Pieces between zeros that were no frame: garbage, truncated, merged, wrong CRC."""
        self.unknown = 0
        """Frames with a right CRC whose type or length this version does not know."""
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[Message]:
        """Return the messages that `data` completes, oldest first."""
        pieces = (self._rest + data).split(b"\0")
        self._rest = pieces.pop()
        messages: list[Message] = []
        for piece in pieces:
            if self._skipping:  # the end of a piece already counted as bad
                self._skipping = False
                continue
            if not piece:  # a lone zero flushes the line
                continue
            payload = payload_of(piece) if len(piece) <= MAX_FRAME else None
            if payload is None:
                self.bad += 1
                continue
            message = parse(payload)
            if message is None:
                self.unknown += 1
            else:
                self.good += 1
                messages.append(message)
        if len(self._rest) > MAX_FRAME:
            if not self._skipping:
                self.bad += 1
            self._rest, self._skipping = b"", True
        return messages
