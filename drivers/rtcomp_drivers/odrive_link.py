"""The host's end of CANSimple: what an axis says, who else is on the bus, requests and replies. No tick."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from rtcomp.errors import DeviceBusyError, DeviceError, DeviceTimeoutError, ProtocolError
from rtcomp_drivers import cansimple as c
from rtcomp_drivers.can_link import CanLink, CanSettings
from rtcomp_drivers.cansimple import CLOSED_LOOP, FROM_A_MASTER, IDLE, Command, Heartbeat

if TYPE_CHECKING:
    import can

ASK_AGAIN_S = 0.1
"""s after which a request without reply is sent again."""
LISTEN_S = 0.15
"""s that are listened at least before anything is sent: a second master shows itself in that time."""
HEARTBEATS_S = 0.5
"""s in which an axis that did what it was asked has said so: five heartbeats."""
_SLACK_S = 0.3
"""s after the watchdog's time in which the next heartbeat tells of it."""


class OdriveLink:
    """A bus with one ODrive axis on it that is ours. `who` is how messages to people call it."""

    def __init__(self, settings: CanSettings, node: int, dialect: str) -> None:
        self.can = CanLink(settings)
        self.node = node
        self.dialect = dialect
        self.who = f"ODrive node {node} on {self.can.who.removeprefix('CAN interface ')}"
        self.heartbeat: Heartbeat | None = None
        """The newest."""
        self.heard = time.monotonic()
        """When it came."""
        self.estimates: bytes | bytearray = b""
        """Data of the newest encoder estimates."""
        self.others: set[int] = set()
        """Numbers of other nodes heard."""
        self.second_master: str | None = None
        """What somebody else sent to our axis."""
        self.estop = False
        """Whether somebody sent an emergency stop to it."""
        self.damaged = 0
        """Frames of our axis that have not the length they should have."""
        self._replies: dict[int, bytes] = {}

    def take(self, message: can.Message) -> bool:
        """Take note of a frame; return whether it holds encoder estimates of our axis."""
        number = message.arbitration_id
        if message.is_extended_id or message.is_fd:
            return False
        command = number & 0x1F
        if number >> 5 != self.node:
            if command == Command.HEARTBEAT:
                self.others.add(number >> 5)
            return False
        if command == Command.ESTOP:
            self.estop = True
        elif message.is_remote_frame or command in FROM_A_MASTER:
            kind = "a request" if message.is_remote_frame else "a command"
            self.second_master = f"{kind} (0x{command:02X})"
        elif command == Command.ENCODER_ESTIMATES:
            if len(message.data) == 8:
                self.estimates = message.data
                return True
            self.damaged += 1
        elif command == Command.HEARTBEAT:
            beat = c.decode_heartbeat(message.data, self.dialect)
            if beat is None:
                self.damaged += 1
            else:
                self.heartbeat, self.heard = beat, time.monotonic()
        else:
            self._replies[command] = bytes(message.data)
        return False

    def send(self, command: int, data: bytes) -> None:
        """Send a command. Raises DeviceError where it cannot leave."""
        self.can.send(self.message(command, data))

    def message(self, command: int, data: bytes | None) -> can.Message:
        """Make the frame of a command, or, without data, of a request: to be sent many times."""
        import can

        return can.Message(
            arbitration_id=c.identifier(self.node, command), is_extended_id=False,
            is_remote_frame=data is None, dlc=8 if data is None else len(data), data=data,
        )  # fmt: skip

    def wait(self, seconds: float, until: Callable[[], bool]) -> bool:
        """Take what comes until it makes `until()` true; return whether it did within `seconds`."""
        end = time.monotonic() + seconds
        while not until():
            message = self.can.receive(end - time.monotonic())
            if message is None:
                return until()
            self.take(message)
        return True

    def listen(self, patience: float) -> Heartbeat:
        """Listen, sending nothing, until our axis has said how it is; return that.

        Raises DeviceTimeoutError where it says nothing in `patience` s, DeviceBusyError where another master
        speaks to it.
        """
        self.wait(LISTEN_S, lambda: False)
        if not self.wait(patience - LISTEN_S, lambda: self.heartbeat is not None):
            if self.others:
                nodes = ", ".join(map(str, sorted(self.others)))
                advice = f"of the axes heard none has that number: set node_id (heard: {nodes})"
            else:
                advice = (
                    "nothing at all was heard; check power, wiring, the two 120 ohm terminations, that the "
                    f"bit rate is {self.can.bitrate} there too, and that heartbeats are on{self.can.doubt}"
                )
            raise DeviceTimeoutError(f"{self.who}: no heartbeat in {patience:g} s; {advice}")
        self.check_alone()
        return self.beat

    @property
    def beat(self) -> Heartbeat:
        """The newest heartbeat, where there has been one."""
        assert self.heartbeat is not None
        return self.heartbeat

    def check_alone(self) -> None:
        """Raise DeviceBusyError where another master speaks to our axis, DeviceError at an emergency stop."""
        if self.estop:
            raise DeviceError(f"{self.who}: emergency stop on the bus; the axis is off until it is cleared")
        if self.second_master is not None:
            raise DeviceBusyError(
                f"{self.who}: somebody else on the bus sends it {self.second_master}; only one master may"
            )

    def ask(self, command: Command, patience: float = 3 * ASK_AGAIN_S) -> bytes | None:
        """Ask for a frame, again and again, until it comes; return its data, None where it does not come."""
        self._replies.pop(command, None)
        end = time.monotonic() + patience
        request = self.message(command, None)
        while (now := time.monotonic()) < end:
            self.can.send(request)
            if self.wait(min(ASK_AGAIN_S, end - now), lambda: command in self._replies):
                return self._replies[command]
        return None

    def check_version(self) -> c.Version | None:
        """Return the firmware's version, None where the dialect has no way to ask.

        Raises ProtocolError for one that is not the dialect's, or none.
        """
        if self.dialect != "0.6":
            return None
        data = self.ask(Command.VERSION)
        version = None if data is None else c.decode_version(data)
        if version is None:
            raise ProtocolError(
                f"{self.who}: does not say its version; update it to firmware 0.6, or, where it is an ODrive "
                "3.x, set firmware: '0.5.6'"
            )
        if version.firmware[:2] != (0, 6):
            has = ".".join(map(str, version.firmware))
            raise ProtocolError(f"{self.who}: has firmware {has}; this driver speaks that of 0.6 and 0.5.6")
        return version

    def clear(self) -> bool:
        """Clear the errors; return whether a heartbeat says that they are gone."""
        self.send(Command.CLEAR_ERRORS, c.encode_clear(self.dialect))
        self._forget()
        return self.wait(HEARTBEATS_S, lambda: self.heartbeat is not None and not self.faulty)

    @property
    def faulty(self) -> bool:
        """Whether the newest heartbeat tells of an error."""
        return self.heartbeat is not None and bool(self.heartbeat.error or self.heartbeat.parts)

    @property
    def errors(self) -> str:
        """The newest heartbeat's errors by their names."""
        beat = self.beat
        parts = [f"{part} error (see odrivetool)" for part in beat.parts]
        named = [c.error_names(beat.error, self.dialect)] if beat.error or not parts else []
        return ", ".join(named + parts)

    def close_loop(self) -> None:
        """Have the axis close its loop on a torque of zero; whether it did, its heartbeats tell."""
        self.send(Command.CONTROLLER_MODE, c.encode_mode())
        self.send(Command.INPUT_TORQUE, c.encode_torque(0.0))
        self.send(Command.AXIS_STATE, c.encode_state(CLOSED_LOOP))

    def open_loop(self, patience: float = HEARTBEATS_S) -> bool:
        """Zero the torque and go to IDLE; return whether a heartbeat confirmed that."""
        end = time.monotonic() + patience
        while (now := time.monotonic()) < end:
            self.send(Command.INPUT_TORQUE, c.encode_torque(0.0))
            self.send(Command.AXIS_STATE, c.encode_state(IDLE))
            self._forget()
            confirmed = self.wait(
                min(2 * ASK_AGAIN_S, end - now),
                lambda: self.heartbeat is not None and self.heartbeat.state == IDLE,
            )
            if confirmed:
                return True
        return False

    def prove_watchdog(self, watchdog: float) -> None:
        """Close the loop on zero torque, fall silent, and see the axis open it by itself in `watchdog` s.

        CANSimple has no frame to read the watchdog's setting with; this needs none. Raises DeviceError where
        the axis does not close its loop, or where it stays closed.
        """
        self._forget()
        self.close_loop()
        self.wait(HEARTBEATS_S, lambda: self.heartbeat is not None and self._moved_on)
        if self.heartbeat is not None and self.beat.state == CLOSED_LOOP:
            self.wait(watchdog + _SLACK_S, lambda: self.beat.state != CLOSED_LOOP)
        if self.heartbeat is None:
            raise DeviceTimeoutError(f"{self.who}: its heartbeat has stopped")
        if self.beat.state == CLOSED_LOOP:
            self.open_loop()
            raise DeviceError(
                f"{self.who}: stays on without commands for longer than device.watchdog = {watchdog:g} s; "
                f"set axis0.config.watchdog_timeout = {watchdog:g} and enable_watchdog = True with odrivetool"
            )
        if not (self.beat.error & c.error_bit("WATCHDOG_TIMER_EXPIRED", self.dialect)):
            state = c.STATES.get(self.beat.state, f"state {self.beat.state}")
            raise DeviceError(
                f"{self.who}: does not close its loop ({state}, errors: {self.errors}); is it calibrated?"
            )
        if not self.clear():
            raise DeviceError(f"{self.who}: its watchdog's error cannot be cleared ({self.errors})")

    @property
    def _moved_on(self) -> bool:
        return self.faulty or self.beat.state != IDLE

    def _forget(self) -> None:
        """Wait for a heartbeat that is newer than now."""
        self.heartbeat = None
