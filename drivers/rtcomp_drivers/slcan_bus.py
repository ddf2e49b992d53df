"""python-can's slcan bus, made fit for a loop: nothing blocks, damaged lines are dropped, not obeyed.

Opening, bit rate and closing are python-can's. Its own receiving reads byte by byte through pyserial (twice
the time), ends in a ValueError at noise and takes a line that was cut for a frame; its own sending waits for
as long as the other side does not read. Here both go by the raw descriptor.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
from collections import deque
from time import monotonic
from time import time as wall_time
from typing import Any

import can
from can.interfaces.slcan import slcanBus

from rtcomp_drivers.slcan import LONGEST, decode

_MOST = 4096
_QUIET_S = 0.02
"""s of silence after which an adapter has answered all that opening it asked."""
_OPENING_S = 0.2
"""s that this is waited for at most, on a bus that is never silent."""
_OPENING_WRITE_S = 0.5
"""s that opening and closing may wait for an adapter that does not read."""


class SlcanBus(slcanBus):
    """An adapter on a serial port or pseudo-terminal; raises what python-can's does."""

    def __init__(self, channel: str, **settings: Any) -> None:
        self.damaged = 0
        """Lines received that were no frame and no answer."""
        self.refused = 0
        """Lines sent that the adapter refused."""
        self._received: deque[can.Message] = deque()
        self._piece = b""
        self._cut = False
        super().__init__(channel, **settings)
        self.serialPortOrig.write_timeout = _OPENING_WRITE_S
        self._descriptor: int = self.serialPortOrig.fileno()

    def forget(self) -> None:
        """Throw away what has come and count from here: the answers to what opening sent, old frames."""
        end = monotonic() + _OPENING_S
        while monotonic() < end and select.select([self._descriptor], [], [], _QUIET_S)[0]:
            self._take()
        self._received.clear()
        self.damaged = self.refused = 0

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._received:
            if timeout is None or timeout > 0.0:
                select.select([self._descriptor], [], [], timeout)
            self._take()
        return (self._received.popleft(), False) if self._received else (None, False)

    def _read_now(self) -> bytes:
        try:
            return os.read(self._descriptor, _MOST)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise can.CanOperationError(os.strerror(error.errno or 0), error.errno) from error

    def _take(self) -> None:
        data = self._read_now()
        if not data:  # nothing there; or hung up: readable, and yet nothing to read
            if not select.select([self._descriptor], [], [], 0.0)[0]:
                return
            data = self._read_now()
            if not data:
                raise can.CanOperationError(os.strerror(errno.EIO), errno.EIO)
        self.refused += data.count(b"\a")
        *lines, piece = (self._piece + data.replace(b"\a", b"\r")).split(b"\r")
        self._piece = piece if len(piece) <= 2 * LONGEST else b"!"  # stays damaged up to its end
        for line in lines:
            if line[:1] not in b"tTrR" or not line:
                self.damaged += line not in (b"", b"z", b"Z") and line[:1] not in b"VNF"
                continue
            frame = decode(line)
            if frame is None:
                self.damaged += 1
                continue
            message = can.Message(
                timestamp=wall_time(),
                arbitration_id=frame.identifier,
                is_extended_id=frame.extended,
                is_remote_frame=frame.remote,
                dlc=frame.asked if frame.remote else len(frame.data),
                data=frame.data,
            )
            self._received.append(message)

    def shutdown(self) -> None:
        """Close the channel and the port, also where the adapter has gone; again does nothing."""
        with contextlib.suppress(can.CanError, OSError, AttributeError):  # the last: it was never opened
            super().shutdown()
        with contextlib.suppress(OSError, AttributeError):
            self.serialPortOrig.close()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a classic frame now, or raise CanOperationError (ENOBUFS where the line takes no more)."""
        head = "T%08X" if msg.is_extended_id else "t%03X"
        if msg.is_remote_frame:
            line = f"{(head % msg.arbitration_id).translate(_REMOTE)}{msg.dlc}\r"
        else:
            line = f"{head % msg.arbitration_id}{msg.dlc}{msg.data.hex().upper()}\r"
        data = ("\r" + line if self._cut else line).encode()  # first end the piece that went out last time
        try:
            sent = os.write(self._descriptor, data)
        except BlockingIOError:
            sent = 0
        except OSError as error:
            raise can.CanOperationError(os.strerror(error.errno or 0), error.errno) from error
        if sent < len(data):
            self._cut = self._cut or sent > 0
            raise can.CanOperationError(os.strerror(errno.ENOBUFS), errno.ENOBUFS)
        self._cut = False


_REMOTE = str.maketrans("tT", "rR")
