"""What goes between the loop and a CiA 402 drive once its PDOs are mapped: frames by hand, in one thread.

Out: the RPDO with controlword and torque; SYNC, on which the drive samples and then acts; our heartbeat.
In: the TPDO with statusword and position, heartbeats, emergencies, and what should not be there.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NoReturn

import can

from rtcomp.errors import DeviceBusyError, DeviceError
from rtcomp.loop.device import OK, Sample
from rtcomp_drivers.cia402_states import (
    ENABLED_BITS,
    ENABLED_MASK,
    State,
    error_name,
    register_names,
    state_of,
)
from rtcomp_drivers.quality import LinkQuality

if TYPE_CHECKING:
    from rtcomp_drivers.can_link import CanLink
    from rtcomp_drivers.cia402_settings import Cia402Settings

_RPDO = struct.Struct("<Hh")
_TPDO = struct.Struct("<Hi")
_EMERGENCY = struct.Struct("<HB")
_OPERATIONAL, _BOOT_UP = 0x05, 0x00
STEP_S = 0.05
"""s to wait for the answer to a SYNC outside the loop."""


class Talk:
    """One drive on one link. `counters` are counted in; `count_size` (m, rad) is to be set before samples."""

    def __init__(self, link: CanLink, settings: Cia402Settings, counters: dict[str, int]) -> None:
        node, host = settings.node, settings.host_node
        self.link = link
        self.who = f"drive {node} on {link.who}"
        self.count_size = 1.0
        self.armed = False
        """Whether the drive is to be enabled: all that says otherwise is an error from then on."""
        self.state: State | None = None
        """Of the drive, as far as known."""
        self.failure: DeviceError | None = None
        """What ended being armed; nothing is sent to a drive that left by itself."""
        self.emergency: tuple[int, int] | None = None
        """Error code and register of the newest emergency."""
        self.why: Callable[[], str] = self.says_emergency
        """Asks for the reason of a fault; may take its time."""
        self.sequence = 0
        """Counts SYNCs."""
        self.answered = 0
        """The SYNC that the newest sample answers."""
        self.synced = 0.0
        """When the newest SYNC was sent, s, monotonic."""
        self.heard_beat = math.inf
        """When the drive's heartbeat was heard last."""
        self.last: Sample | None = None
        self._counters = counters
        self._rpdo = can.Message(arbitration_id=0x200 + node, is_extended_id=False, data=bytes(_RPDO.size))
        self._sync = can.Message(arbitration_id=0x080, is_extended_id=False)
        self._beat = can.Message(arbitration_id=0x700 + host, is_extended_id=False, data=[_OPERATIONAL])
        self._tpdo_id, self._emergency_id, self._beat_id = 0x180 + node, 0x080 + node, 0x700 + node
        self._answer_id = 0x580 + node
        self._masters = (0x000, 0x080, 0x200 + node, 0x700 + host)
        self._quality = LinkQuality()
        self._damaged = 0
        self._origin = time.monotonic()
        self._counts: int | None = None
        self._owed = 0
        """SYNCs whose sample has not come."""
        self._statusword = 0

    def send(self, controlword: int, torque: int) -> None:
        """Send a command (torque in thousandths) and SYNC; raise DeviceError where they cannot leave."""
        _RPDO.pack_into(self._rpdo.data, 0, controlword, torque)
        self.link.send(self._rpdo)
        self.sequence += 1
        self._owed = min(self._owed + 1, 2)  # a lost sample must not stand for a later duplicate for ever
        self._counters["sent"] += 1
        self.synced = time.monotonic()
        self.link.send(self._sync)

    def beat(self) -> None:
        """Send the host's heartbeat: it feeds the drive's watchdog."""
        self.link.send(self._beat)

    def drain(self) -> None:
        """Act on what has come."""
        while (message := self.link.receive(0.0)) is not None:
            self.hear(message)

    def wait(self, deadline: float) -> bool:
        """Act on what comes until the newest SYNC is answered or `deadline` (s); return whether it was."""
        while self.answered != self.sequence:
            message = self.link.receive(max(0.0, deadline - time.monotonic()))
            if message is None:
                return False
            self.hear(message)
        return True

    def step(self, controlword: int) -> bool:
        """Send a controlword with zero torque, outside the loop, and see what came of it.

        Returns whether the drive answered. A sample is from before its SYNC's command: a second shows it.
        """
        for _ in range(2):
            self.send(controlword, 0)
            if not self.wait(self.synced + STEP_S):
                return False
        self.state = state_of(self._statusword)
        return True

    def hear(self, message: can.Message) -> None:
        """Act on a frame. Raises DeviceBusyError at another master's, DeviceError where the drive failed."""
        identifier, data = message.arbitration_id, message.data
        if message.is_remote_frame or message.is_extended_id:
            self._counters["other_frames"] += 1
        elif identifier == self._tpdo_id:
            self._sampled(data)
        elif identifier == self._beat_id:
            self._heartbeat(data)
        elif identifier == self._emergency_id:
            self._warned(data)
        elif identifier == self._answer_id:
            pass  # to an SDO request; whoever asked looks at it
        elif identifier in self._masters:
            self.failure = DeviceBusyError(
                f"{self.who}: another master is on the bus (a frame {identifier:03X}h came from elsewhere); "
                "end that one"
            )
            raise self.failure
        else:
            self._counters["other_frames"] += 1
        if self.link.damaged != self._damaged:
            self._bad(self.link.damaged - self._damaged)
            self._damaged = self.link.damaged

    def _sampled(self, data: bytearray) -> None:
        if len(data) != _TPDO.size:
            self._bad(1)
            return
        self._statusword, raw = _TPDO.unpack(data)
        if self._watching and self._statusword & ENABLED_MASK != ENABLED_BITS:
            self.state = state_of(self._statusword)
            says = "no state that CiA 402 knows" if self.state is None else self.state.value
            self._fail(f"is not enabled any more but in '{says}'")
        if not self._owed:
            self._counters["duplicate"] += 1  # nobody asked for it
            return
        self._owed -= 1
        self._counters["late"] += self.answered == self.sequence  # one came that had been taken for lost
        if self._counts is None:
            self._counts = raw
        else:  # 32 bits of a position that goes on beyond them: the nearest that has these
            self._counts += ((raw - self._counts + 0x80000000) & 0xFFFFFFFF) - 0x80000000
        self.answered = self.sequence
        self._counters["samples"] += 1
        self._quality.too_bad(1, 0, self.synced)
        self.last = Sample(self._counts * self.count_size, self.synced - self._origin, self.sequence, OK)

    def _heartbeat(self, data: bytearray) -> None:
        if len(data) != 1:
            self._bad(1)
            return
        self.heard_beat = time.monotonic()
        state = data[0] & 0x7F
        if self._watching and state != _OPERATIONAL:
            self._fail("was reset" if state == _BOOT_UP else f"is not operational (NMT state {state:02X}h)")

    def _warned(self, data: bytearray) -> None:
        if len(data) != 8:
            self._bad(1)
            return
        code, register = _EMERGENCY.unpack_from(data)
        if not code & 0xFF00:  # an error that has gone
            return
        self.emergency = (code, register)
        if self._watching:
            self._fail("sent an emergency")
        self._counters["warnings"] += 1

    @property
    def _watching(self) -> bool:
        return self.armed and self.failure is None

    def _fail(self, what: str) -> NoReturn:
        """Keep and raise the error; asking the drive for the reason reads the bus again, which must not."""
        self.failure = DeviceError(f"{self.who}: {what}")
        self.failure = DeviceError(f"{self.who}: {what}: {self.why()}")
        raise self.failure

    def says_emergency(self) -> str:
        """Return what the newest emergency means."""
        if self.emergency is None:
            return "it says no reason"
        code, register = self.emergency
        return f"{error_name(code)}, error register: {register_names(register)}"

    def _bad(self, frames: int) -> None:
        self._counters["bad_frames"] += frames
        if self._quality.too_bad(0, frames, time.monotonic()):
            raise DeviceError(
                f"{self.who}: over 10 % of the frames of half a second were damaged; check bit rate, wiring "
                "and the two 120 ohm terminations"
            )
