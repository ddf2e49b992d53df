"""A CANopen SDO server, as a pure state machine: requests in, responses out (CiA 301, 7.2.4).

Expedited transfers both ways, and segmented upload for what is longer than four bytes. What it serves is
whatever `read` and `write` make of an index and a sub-index; they raise `SdoAbort`.
"""

from __future__ import annotations

from collections.abc import Callable
from struct import Struct

UNKNOWN_COMMAND, TOGGLE = 0x05040001, 0x05030000
UNSUPPORTED, WRITE_ONLY, READ_ONLY = 0x06010000, 0x06010001, 0x06010002
NO_OBJECT, NOT_MAPPABLE, PDO_TOO_LONG = 0x06020000, 0x06040041, 0x06040042
WRONG_LENGTH, NO_SUB_INDEX, BAD_VALUE = 0x06070010, 0x06090011, 0x06090030
WRONG_STATE = 0x08000022

_HEAD = Struct("<BHB")
_ABORT = Struct("<BHBI")
_SIZED = Struct("<BHBI")


class SdoAbort(Exception):  # noqa: N818 - a message of the protocol
    """Ends a transfer with a code of CiA 301."""

    def __init__(self, code: int) -> None:
        super().__init__(f"SDO abort {code:08X}h")
        self.code = code


class SdoServer:
    """The server; one transfer at a time."""

    def __init__(self, read: Callable[[int, int], bytes], write: Callable[[int, int, bytes], None]) -> None:
        self._read = read
        self._write = write
        self._rest: bytes | None = None
        self._toggle = 0
        self._at = (0, 0)

    def answer(self, request: bytes) -> bytes | None:
        """Return the response to a request; None to what is none, or asks for none (a client's abort)."""
        if len(request) != 8:
            return None
        command, index, sub = _HEAD.unpack_from(request)
        kind = command >> 5
        if kind == 4:
            self._rest = None
            return None
        if kind in (1, 2):  # the segments of a transfer do not name it
            self._at = (index, sub)
        try:
            if kind == 1:
                return self._download(command, request)
            if kind == 2:
                return self._upload()
            if kind == 3:
                return self._segment(command)
            raise SdoAbort(UNKNOWN_COMMAND)
        except SdoAbort as abort:
            self._rest = None
            return _ABORT.pack(0x80, *self._at, abort.code)

    def _download(self, command: int, request: bytes) -> bytes:
        self._rest = None
        if not command & 2:  # segmented: nothing that is writable here is longer than four bytes
            raise SdoAbort(WRONG_LENGTH)
        size = 4 - (command >> 2 & 3) if command & 1 else 4
        self._write(*self._at, request[4 : 4 + size])
        return _HEAD.pack(0x60, *self._at).ljust(8, b"\0")

    def _upload(self) -> bytes:
        data = self._read(*self._at)
        if len(data) <= 4:
            self._rest = None
            return (_HEAD.pack(0x43 | (4 - len(data)) << 2, *self._at) + data).ljust(8, b"\0")
        self._rest, self._toggle = data, 0
        return _SIZED.pack(0x41, *self._at, len(data))

    def _segment(self, command: int) -> bytes:
        if self._rest is None:
            raise SdoAbort(UNKNOWN_COMMAND)
        if command & 0x10 != self._toggle:
            raise SdoAbort(TOGGLE)
        piece, rest = self._rest[:7], self._rest[7:]
        head = self._toggle | (7 - len(piece)) << 1 | (not rest)
        self._rest = rest or None
        self._toggle ^= 0x10
        return (bytes([head]) + piece).ljust(8, b"\0")
