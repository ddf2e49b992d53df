"""CAN frames as lines of text, as Lawicel's adapters and their kin (CANable, USBtin) send them.

A line is `t` and three hexadecimal digits of identifier (`T` and eight for an extended one), the number of
data bytes, and the bytes as hexadecimal digits; `r` and `R` are remote frames, which have no data. The
carriage return that ends it is not part of it here. Source: Lawicel, CANUSB manual.
"""

from __future__ import annotations

import re
from typing import NamedTuple

MOST_STANDARD = 0x7FF
MOST_EXTENDED = 0x1FFFFFFF
MOST_DATA = 8
LONGEST = 1 + 8 + 1 + 2 * MOST_DATA
"""Characters of the longest line."""

_LINE = re.compile(
    rb"(?:t([0-7][0-9A-Fa-f]{2})|T([01][0-9A-Fa-f]{7}))([0-8])((?:[0-9A-Fa-f]{2}){0,8})"
    rb"|(?:r([0-7][0-9A-Fa-f]{2})|R([01][0-9A-Fa-f]{7}))([0-8])"
)


class Frame(NamedTuple):
    """A classic CAN frame."""

    identifier: int
    """11 bits, or 29 where it is extended."""
    data: bytes = b""
    """At most 8 bytes; none in a remote frame."""
    remote: bool = False
    extended: bool = False
    asked: int = 0
    """Number of data bytes that a remote frame asks for."""


def encode(frame: Frame) -> bytes:
    """Return the line of a frame, with the carriage return that ends it."""
    if frame.remote:
        head = b"R%08X" if frame.extended else b"r%03X"
        return head % frame.identifier + b"%d\r" % frame.asked
    head = b"T%08X" if frame.extended else b"t%03X"
    return b"%s%d%s\r" % (head % frame.identifier, len(frame.data), frame.data.hex().upper().encode())


def decode(line: bytes) -> Frame | None:
    """Return the frame that a line (without its carriage return) holds, None where it holds none.

    Nothing is guessed: a line whose data is shorter or longer than it says is no frame.
    """
    match = _LINE.fullmatch(line)
    if match is None:
        return None
    standard, extended, length, data, remote_standard, remote_extended, asked = match.groups()
    if length is None:
        wide = remote_standard is None
        return Frame(int(remote_extended if wide else remote_standard, 16), b"", True, wide, int(asked))
    if len(data) != 2 * int(length):
        return None
    wide = standard is None
    return Frame(int(extended if wide else standard, 16), bytes.fromhex(data.decode()), False, wide)
