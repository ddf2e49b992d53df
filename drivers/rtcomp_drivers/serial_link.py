"""The host's end of the serial protocol: who is there, requests and their replies. No loop, no tick."""

from __future__ import annotations

import time
from typing import TypeVar

from rtcomp.errors import DeviceError, DeviceTimeoutError, ProtocolError
from rtcomp_drivers import protocol
from rtcomp_drivers.quality import LinkQuality
from rtcomp_drivers.serial_port import SerialPort

M = TypeVar("M", bound=protocol.Message)

ASK_AGAIN_S = 0.1
"""s after which a request without reply is sent again."""


class SerialLink:
    """A port with a decoder on it. `who` is how messages to people call the other side."""

    def __init__(self, path: str, baudrate: int) -> None:
        self.port = SerialPort(path, baudrate)
        self.port.discard_input()
        self.decoder = protocol.Decoder()
        self.who = f"board on {path}"
        self._quality = LinkQuality()
        self._tag = 0

    def next_tag(self) -> int:
        """Return the tag of a new request, by which its reply is known."""
        self._tag = self._tag % 255 + 1
        return self._tag

    def hello(self, patience: float) -> protocol.Info:
        """Ask who is there until somebody answers; a board that resets when its port opens takes seconds.

        Raises DeviceTimeoutError where nothing comes in `patience` s, ProtocolError where something else
        does.
        """
        path = self.port.path
        end = time.monotonic() + patience
        heard = 0
        while (now := time.monotonic()) < end:
            self.port.write(b"\0" + protocol.encode(protocol.Hello(self.next_tag())))
            again = min(now + ASK_AGAIN_S, end)
            while (left := again - time.monotonic()) > 0.0:
                data = self.port.read(left)
                heard += len(data)
                for message in self.decoder.feed(data):
                    if isinstance(message, protocol.Info):
                        if message.text:
                            self.who = f"board on {path} ({message.text})"
                        return message
                    self._refuse(message)
        if heard:
            raise ProtocolError(
                f"serial port {path} belongs to something else: {heard} bytes came in {patience:g} s, "
                "no answer among them that follows the protocol; check port and baud rate"
            )
        raise DeviceTimeoutError(
            f"serial port {path}: nothing answered in {patience:g} s; check that the board is powered, "
            "runs the firmware, and that this is its port"
        )

    def ask(
        self, request: protocol.Arm | protocol.Clear | protocol.Disarm, patience: float = 3 * ASK_AGAIN_S
    ) -> protocol.Reply:
        """Send a request, again and again, until its reply comes; DeviceTimeoutError where none does."""
        end = time.monotonic() + patience
        while (now := time.monotonic()) < end:
            self.port.write(protocol.encode(request))
            again = min(now + ASK_AGAIN_S, end)
            while (left := again - time.monotonic()) > 0.0:
                for message in self.decoder.feed(self.port.read(left)):
                    if isinstance(message, protocol.Reply) and message.tag == request.tag:
                        return message
        what = type(request).__name__.upper()
        raise DeviceTimeoutError(f"{self.who}: no reply to {what} in {patience:.1f} s")

    def take(self, seconds: float) -> list[protocol.Message] | None:
        """Return the messages completed by what comes within `seconds`; None where nothing comes.

        Raises DeviceError where too many frames are damaged to drive a motor by.
        """
        data = self.port.read(seconds)
        if not data:
            return None
        decoder = self.decoder
        good, bad = decoder.good, decoder.bad
        messages = decoder.feed(data)
        if self._quality.too_bad(decoder.good - good, decoder.bad - bad, time.monotonic()):
            raise DeviceError(
                f"{self.who}: over 10 % of the frames of half a second were damaged ({decoder.bad} so far); "
                "check cable, ground and baud rate"
            )
        return messages

    def _refuse(self, message: protocol.Message) -> None:
        """Raise ProtocolError for an answer that shows that no board is there with which to talk."""
        path = self.port.path
        if isinstance(message, protocol.OtherVersion):
            raise ProtocolError(
                f"board on {path} speaks protocol version {message.version}, this program "
                f"{protocol.VERSION}; update the older of the two"
            )
        if isinstance(message, protocol.Hello):
            raise ProtocolError(
                f"serial port {path} sends back what it is sent, or another host is on it; "
                "a board must be at its other end"
            )
