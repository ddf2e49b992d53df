"""The host's end of a CAN bus, for every CAN driver: no thread, deadlines by `select`, one-line errors."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import select
import socket
import subprocess
import time
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from pydantic import Field

from rtcomp.errors import ConfigError, DeviceBusyError, DeviceError, nearest
from rtcomp_drivers.link_settings import LinkSettings
from rtcomp_drivers.serial_port import SerialPort

if TYPE_CHECKING:
    import can

_BUS_OFF = 0x40
"""Class of an error frame of the kernel's: the controller has left the bus."""
_FULL = (errno.ENOBUFS, errno.EAGAIN, None)
"""Error codes of a send queue that takes no more; python-can gives none for its own time-out."""


_MOST_ECHOES = 256
_Content = tuple[int, bool, bytes]


def _content(message: can.Message) -> _Content:
    return message.arbitration_id, message.is_remote_frame, bytes(message.data)


class CanSettings(LinkSettings):
    """The settings that every CAN driver has."""

    interface: str = Field(
        "socketcan", description="socketcan, slcan, udp_multicast, virtual, or another that python-can knows"
    )
    channel: str = Field(min_length=1, description="such as can0; for slcan the adapter's serial port")
    bitrate: int = Field(1_000_000, ge=10_000, le=1_000_000, description="bit/s, of the bus")
    baudrate: int = Field(
        1_000_000, ge=9600, le=12_000_000, description="of an slcan adapter's port; means nothing on USB"
    )


def check_interface(settings: CanSettings) -> None:
    """Raise ConfigError for an interface that python-can does not know or a bit rate it cannot set."""
    can = _can()
    if settings.interface not in can.VALID_INTERFACES:
        raise ConfigError(
            f"device: interface {settings.interface!r} is unknown to python-can; "
            f"{nearest(settings.interface, can.VALID_INTERFACES)}",
            key=("interface",),
        )
    if settings.interface == "slcan":
        from rtcomp_drivers.slcan_adapter import BIT_RATES

        allowed = sorted(BIT_RATES.values())
        if settings.bitrate not in allowed:
            raise ConfigError(
                f"device: bitrate is {settings.bitrate} bit/s; an slcan adapter takes one of "
                f"{', '.join(map(str, allowed))}",
                key=("bitrate",),
            )


class CanLink:
    """An open bus; `who` is how messages to people call it. Not for use from several threads.

    Raises ConfigError for settings that cannot be, DeviceError where the interface is missing, is no CAN
    interface, or has another bit rate, and DeviceBusyError where its serial port is used by another program.
    """

    def __init__(self, settings: CanSettings) -> None:
        check_interface(settings)
        self.who = f"CAN interface {settings.interface} {settings.channel}"
        self.bitrate = settings.bitrate
        self._port: SerialPort | None = None
        """Holds an slcan adapter's port for us alone while the bus uses it."""
        self.error_frames = 0
        """Error frames that the kernel reported."""
        if settings.interface == "socketcan":
            check_socketcan(settings.channel, settings.bitrate)
        elif settings.interface == "slcan":
            self._port = SerialPort(settings.channel, settings.baudrate)
            self._port.write(b"\r\rC\r")  # ends what a host that died may have left on the line
            self._port.discard_input()
        try:
            self.bus = self._open(settings)
        except BaseException:
            if self._port is not None:
                self._port.close()
            raise
        try:
            self._descriptor: int | None = self.bus.fileno()
        except NotImplementedError:
            self._descriptor = None
        self._watched = [] if self._descriptor is None else [self._descriptor]
        self._failures = (_can().CanError, OSError, ValueError)
        # On python-can's multicast bus every node hears itself too; a master must not take that for another.
        self._echoes: deque[_Content] | None = None
        if settings.interface == "udp_multicast":
            self._echoes = deque(maxlen=_MOST_ECHOES)
        self._is_open = True

    @property
    def latency_timer_ms(self) -> int | None:
        """The USB adapter's latency timer as it is in force; None where there is none."""
        return None if self._port is None else self._port.latency_timer_ms

    @property
    def damaged(self) -> int:
        """Lines of an slcan adapter that were no frame, so far."""
        return getattr(self.bus, "damaged", 0)

    @property
    def doubt(self) -> str:
        """What to ask about the port where nobody answers; empty where it is no serial port."""
        if self._port is None:
            return ""
        told = f", {self.damaged} lines came that are no frames" if self.damaged else ""
        return f"{told}; is it an slcan adapter?"

    def receive(self, seconds: float) -> can.Message | None:
        """Return the oldest frame not yet received, waiting at most `seconds`; None where none comes.

        Raises DeviceError where the interface has gone or the controller has left the bus.
        """
        end = time.monotonic() + seconds
        try:
            while True:
                message = self.bus.recv(0)
                if message is not None:
                    if self._is_ours_to_have(message):
                        return message
                    continue
                left = end - time.monotonic()
                if left <= 0.0:
                    return None
                if self._descriptor is None:
                    message = self.bus.recv(left)
                    if message is None or self._is_ours_to_have(message):
                        return message
                elif not select.select(self._watched, [], [], left)[0]:
                    return None
        except self._failures as error:
            raise self._gone(error) from error

    def send(self, message: can.Message) -> None:
        """Send a frame now; raise DeviceError where it cannot leave: queue full, bus off, unplugged."""
        if self._echoes is not None:
            self._echoes.append(_content(message))
        try:
            self.bus.send(message)
        except self._failures as error:
            raise self._gone(error) from error

    def close(self) -> None:
        """Let go of the bus, whatever state it is in; does nothing where it is closed already."""
        if not self._is_open:
            return
        self._is_open = False
        with contextlib.suppress(*self._failures):
            self.bus.shutdown()
        if self._port is not None:
            self._port.close()

    def _open(self, settings: CanSettings) -> can.BusABC:
        library = _can()
        interface, channel = settings.interface, settings.channel
        try:
            if interface == "slcan":
                from rtcomp_drivers.slcan_bus import SlcanBus

                extra: dict[str, Any] = {}
                if os.path.realpath(channel).startswith("/dev/pts/"):
                    extra["sleep_after_open"] = 0.0  # nothing that resets when its port is opened
                adapter = SlcanBus(channel, bitrate=settings.bitrate, tty_baudrate=settings.baudrate, **extra)
                adapter.forget()
                return adapter
            bus = library.Bus(interface=interface, channel=channel, bitrate=settings.bitrate)
            return cast("can.BusABC", bus)
        except DeviceError:
            raise
        except (library.CanError, OSError, ValueError, TypeError, ImportError, NotImplementedError) as error:
            code = getattr(error, "error_code", None) or getattr(error, "errno", None)
            if code in (errno.EBUSY, errno.EADDRINUSE):
                raise DeviceBusyError(f"{self.who} is busy: another program uses it; end that one") from error
            raise DeviceError(f"{self.who} cannot be opened ({_one_line(error)})") from error

    def _is_ours_to_have(self, message: can.Message) -> bool:
        """Tell a frame of somebody else's from our own that comes back, and from an error frame."""
        if message.is_error_frame:
            self._error_frame(message)
            return False
        if self._echoes:
            content = _content(message)
            if content in self._echoes:
                self._echoes.remove(content)
                return False
        return True

    def _error_frame(self, message: can.Message) -> None:
        self.error_frames += 1
        if message.arbitration_id & _BUS_OFF:
            raise DeviceError(
                f"{self.who}: bus off, the controller has given up after too many errors; check bit rate, "
                "wiring and the two 120 ohm terminations"
            )

    def _gone(self, error: Exception) -> DeviceError:
        if isinstance(error, DeviceError):
            return error
        code = getattr(error, "error_code", None)
        if isinstance(error, OSError):
            code = error.errno
        if isinstance(error, _can().CanError) and code in _FULL:
            return DeviceError(
                f"{self.who}: its send queue is full, nobody takes or acknowledges frames; check power, bit "
                "rate, wiring and the two 120 ohm terminations"
            )
        if code == errno.ENETDOWN:
            return DeviceError(f"{self.who} is down (bus off, or taken down); {_up(self.who, self.bitrate)}")
        return DeviceError(f"{self.who} has gone ({_one_line(error)}); was it unplugged, or its plant ended?")


def check_socketcan(channel: str, bitrate: int) -> None:
    """Raise DeviceError where the kernel has no such CAN interface, or it is down or has another bit rate."""
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except (AttributeError, OSError):
        raise DeviceError(
            f"CAN interface socketcan {channel}: this kernel has no CAN sockets (AF_CAN); "
            "sudo modprobe can can_raw, or use an adapter that speaks slcan (interface: slcan)"
        ) from None
    if not Path("/sys/class/net", channel).exists():
        raise DeviceError(f"CAN interface {channel} does not exist; {_up(channel, bitrate)}")
    found = configured(channel)
    if not found.get("up", True):
        raise DeviceError(f"CAN interface {channel} is down; {_up(channel, bitrate)}")
    actual = found.get("bitrate", bitrate)
    if actual != bitrate:
        raise DeviceError(
            f"CAN interface {channel} runs at {actual} bit/s, device.bitrate is {bitrate}; set one to the "
            f"other: sudo ip link set {channel} down, then {_up(channel, bitrate)}"
        )


def configured(channel: str) -> dict[str, int]:
    """Return what `ip` says of an interface: ``up`` (0, 1) and ``bitrate`` (bit/s), as far as it does."""
    try:
        said = subprocess.run(
            ["ip", "-json", "-details", "link", "show", "dev", channel],
            capture_output=True, timeout=2.0, check=True,
        ).stdout  # fmt: skip
        (link,) = json.loads(said)
        found = {"up": int("UP" in link["flags"])}
        rate = link.get("linkinfo", {}).get("info_data", {}).get("bittiming", {}).get("bitrate")
    except (OSError, subprocess.SubprocessError, ValueError, KeyError, TypeError):
        return {}
    return found if rate is None else {**found, "bitrate": int(rate)}


def _up(name: str, bitrate: int) -> str:
    channel = name.split()[-1]
    return f"sudo ip link set {channel} up type can bitrate {bitrate}"


def _one_line(error: Exception) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split()).lower()


def _can() -> Any:
    """Import python-can where it is used: the import takes time that other commands do without."""
    import can

    return can
