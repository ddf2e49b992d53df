"""What a CiA 402 torque drive does, as a pure state machine: CAN frames and time in, frames and volts out.

This is the device side of the driver ``cia402`` around any plant that can be advanced and measured; it has no
bus and no clock. CANopen of CiA 301: boot-up, NMT, an SDO server, one RPDO and one TPDO that can be mapped,
SYNC, heartbeat both ways, emergencies. CiA 402: the power state machine, modes 4 and 10.

The output is zero in every state but "operation enabled". The heartbeat consumer, 1016h, is the watchdog: a
host whose heartbeat stays away for the time set there takes the output to zero by the axis' own timer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rtcomp_drivers import sdo_server as sdo
from rtcomp_drivers.board import Plant, Zeroing
from rtcomp_drivers.cia402_memory import AxisFacts, Memory, count_exponent
from rtcomp_drivers.cia402_states import (
    CYCLIC_TORQUE,
    MODES,
    PROFILE_TORQUE,
    State,
    statusword_of,
    transition,
)
from rtcomp_drivers.sdo_server import SdoAbort, SdoServer
from rtcomp_drivers.slcan import Frame

if TYPE_CHECKING:
    from rtcomp.stage.stage import Stage
    from rtcomp_drivers.slcan_side import SlcanSide

BOOTED, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0x00, 0x04, 0x05, 0x7F
"""NMT states as heartbeats tell them."""
HEARTBEAT_LOST, SENSOR_FAILED, PDO_TOO_SHORT = 0x8130, 0x7300, 0x8210
NO_ACTION, FAULT_SIGNAL, DISABLE, STOP_QUICKLY = 0, 1, 2, 3
"""Abort connection option codes, 6007h."""
_SYNC = 0x080
_COUNTERS = (
    "commands", "syncs", "ignored", "clamped", "sdo_requests", "bad_frames", "watchdog_trips", "emergencies",
    "zeroed",
)  # fmt: skip
_KEPT = 1000
_REGISTER = {0x8130: 0x11, 0x8210: 0x11, 0x7300: 0x21}
"""Error register, 1001h, by error code."""


class Cia402Axis:
    """The drive; call `receive` when frames come and `run_until` whenever time has passed."""

    def __init__(self, plant: Plant, facts: AxisFacts | None = None) -> None:
        self.plant = plant
        self.facts = facts = facts or AxisFacts()
        self.time = 0.0
        """s, the drive's own clock: how far the plant has been run."""
        self.nmt = BOOTED
        self.state = State.DISABLED
        self.output = 0.0
        """V, what the plant gets."""
        self.lagging = False
        """Set by whoever runs the axis where it cannot keep up."""
        self.zeroings: list[Zeroing] = []
        self.counters = dict.fromkeys(_COUNTERS, 0)
        self.memory = Memory(facts.node)
        self._volts_per_mille = facts.voltage_limit / facts.peak / 1000.0
        self._fix_values(facts)
        self._sdo = SdoServer(self._read, self._write)
        self._sent: list[Frame] = []
        self._now = 0.0
        """The time of what is being dealt with; the plant may be behind it."""
        self._controlword = 0
        self._pending: bytes | None = None
        self._fed = math.inf
        """When the watchdog was fed last; infinite where it does not run."""
        self._beat = math.inf
        """When the next heartbeat is due."""
        self._commanded = 0.0
        self._applied = 0.0
        """When the output was set last."""

    def _fix_values(self, facts: AxisFacts) -> None:
        unit = 0x01 if facts.axis == "linear" else 0x10
        fix = self.memory.fix
        fix(0x60A8, 0, (facts.count_exponent & 0xFF) << 24 | unit << 16)
        fix(0x6072, 0, round(1000 * facts.peak))
        fix(0x6076, 0, max(1, round(1e3 * facts.force_constant * facts.voltage_limit / facts.peak)))

    def run_until(self, now: float) -> list[Frame]:
        """Let time pass to `now` (s); return the frames that the drive sends by itself.

        The watchdog acts at its own instant, not when it is looked at: the plant is run with the old output
        up to there and with zero from there.
        """
        self._now = now
        if self.nmt == BOOTED:
            self._boot()
        while self._beat <= now:
            self._tell(0x700 + self.facts.node, bytes([self.nmt]))
            self._beat += 1e-3 * max(1, self.memory[0x1017])
        trips = self._fed + 1e-3 * (self.memory.values[0x1016, 1] & 0xFFFF)
        if now >= trips:
            self._pass_time(trips)
            self._fed = math.inf
            self.counters["watchdog_trips"] += 1
            self._lose_host()
        self._pass_time(now)
        sent, self._sent = self._sent, []
        return sent

    def receive(self, frames: Sequence[Frame], now: float) -> list[Frame]:
        """Take frames that arrived at `now`, in their order; return the frames to send."""
        sent = self.run_until(now)
        for frame in frames:
            if not frame.remote and not frame.extended:
                self._take(frame.identifier, frame.data)
        sent += self._sent
        self._sent = []
        return sent

    def shut_down(self, now: float) -> None:
        """Zero the output because the drive itself ends."""
        self.run_until(now)
        self._leave(State.DISABLED, "shut down")

    def fail(self, code: int, now: float, cause: str = "drive") -> list[Frame]:
        """Go into the state FAULT with an error code, as a drive does that finds something wrong."""
        sent = self.run_until(now)
        self._fail(code, cause)
        sent += self._sent
        self._sent = []
        return sent

    def summary(self) -> dict[str, Any]:
        """Return what happened, for a log; times in s on the drive's clock."""
        return {**self.counters, "state": self.state.value, "zeroings": [z._asdict() for z in self.zeroings]}

    def _take(self, identifier: int, data: bytes) -> None:
        node, consumed = self.facts.node, self.memory.values[0x1016, 1]
        if identifier == 0x000:
            self._network_command(data)
        elif identifier == 0x600 + node:
            if self.nmt == STOPPED:
                return
            self.counters["sdo_requests"] += 1
            answer = self._sdo.answer(data)
            if answer is not None:
                self._tell(0x580 + node, answer)
        elif identifier == 0x700 + (consumed >> 16 & 0x7F):
            if len(data) == 1 and consumed & 0xFFFF:
                self._fed = self._now
        elif self.nmt == OPERATIONAL:
            if identifier == _SYNC:
                self._synchronise()
            elif identifier == self.memory.cob_id(0x1400):
                self._take_rpdo(data)

    def _boot(self) -> None:
        self.nmt = PRE_OPERATIONAL
        self._tell(0x700 + self.facts.node, b"\0")

    def _tell(self, identifier: int, data: bytes) -> None:
        self._sent.append(Frame(identifier, data))

    def _pass_time(self, until: float) -> None:
        seconds = until - self.time
        if seconds > 0.0:
            self.plant.advance(self.output, seconds)
            self.time = until

    def _network_command(self, data: bytes) -> None:
        if len(data) != 2 or data[1] not in (0, self.facts.node):
            self.counters["bad_frames"] += len(data) != 2
            return
        command = data[0]
        if command == 0x01:
            self.nmt = OPERATIONAL
        elif command == 0x02:
            self.nmt = STOPPED
            self._leave(State.DISABLED, "stopped")
        elif command == 0x80:
            self.nmt = PRE_OPERATIONAL
            self._leave(State.DISABLED, "pre-operational")
        elif command in (0x81, 0x82):
            self._leave(State.DISABLED, "reset")
            self.state = State.DISABLED
            self.memory.reset()
            self._fed = self._beat = math.inf
            self._controlword, self._pending = 0, None
            self._boot()

    def _synchronise(self) -> None:
        """Sample first, then let the newest command take effect: so a command never sees its own sample."""
        self.counters["syncs"] += 1
        memory = self.memory
        tpdo = memory.cob_id(0x1800)
        if tpdo is not None and 1 <= memory.values[0x1800, 2] <= 240:
            self._tell(tpdo, b"".join(self._read(index, 0) for index, _, _ in memory.mapping(0x1A00)))
        pending, self._pending = self._pending, None
        if pending is not None:
            self._act(pending)

    def _take_rpdo(self, data: bytes) -> None:
        if len(data) < sum(size for _, size, _ in self.memory.mapping(0x1600)):
            self.counters["bad_frames"] += 1
            self._emergency(PDO_TOO_SHORT)
        elif self.memory.values[0x1400, 2] <= 240:
            self._pending = data
        else:
            self._act(data)

    def _act(self, data: bytes) -> None:
        """Let the values of an RPDO take effect."""
        self.counters["commands"] += 1
        self._commanded = self.time
        place = 0
        controlword = self._controlword
        for index, size, signed in self.memory.mapping(0x1600):
            value = int.from_bytes(data[place : place + size], "little", signed=signed)
            place += size
            if index == 0x6040:
                controlword = value
            elif index != 0x6060 or value in MODES:
                self.memory[index] = value
        self._obey(controlword)
        self._put_out()

    def _put_out(self) -> None:
        """Put out the target torque, within the largest torque and, in profile torque mode, the slope."""
        memory = self.memory
        if self.state is not State.ENABLED or memory[0x6060] not in MODES:
            self.counters["ignored"] += self.state is not State.ENABLED
            return
        most = min(memory[0x6072], round(1000 * self.facts.peak))
        target = float(min(max(memory[0x6071], -most), most))
        self.counters["clamped"] += target != memory[0x6071]
        if memory[0x6060] == PROFILE_TORQUE:
            before = self.output / self._volts_per_mille
            step = memory[0x6087] * (self.time - self._applied)
            target = min(max(target, before - step), before + step)
        self._applied = self.time
        self.output = target * self._volts_per_mille

    def _obey(self, controlword: int) -> None:
        before, self._controlword = self._controlword, controlword
        self.memory[0x6040] = controlword
        after = transition(self.state, controlword, before)
        if after is self.state:
            return
        if self.state is State.FAULT:
            self.memory[0x603F] = self.memory[0x1001] = 0
            self._tell(0x80 + self.facts.node, bytes(8))
        if after is State.ENABLED:
            self._applied = self.time
        self._leave(after, "disabled")
        self.state = after

    def _lose_host(self) -> None:
        """Do what 6007h says about a host that is not there any more."""
        option = self.memory[0x6007]
        if option == FAULT_SIGNAL:
            self._fail(HEARTBEAT_LOST, "watchdog")
            return
        self._emergency(HEARTBEAT_LOST)
        if option == STOP_QUICKLY and self.state is State.ENABLED:
            self._leave(State.QUICK_STOP, "watchdog")
        elif option != NO_ACTION:
            self._leave(State.DISABLED, "watchdog")

    def _fail(self, code: int, cause: str) -> None:
        """Enter FAULT; the reaction to it, zero torque, takes no time."""
        if self.state is State.FAULT:
            return
        self._leave(State.FAULT, cause)
        self.state = State.FAULT
        self._emergency(code)

    def _emergency(self, code: int) -> None:
        memory, values = self.memory, self.memory.values
        self.counters["emergencies"] += 1
        memory[0x603F], memory[0x1001] = code, _REGISTER.get(code, 0x01)
        for sub in (4, 3, 2):
            values[0x1003, sub] = values[0x1003, sub - 1]
        values[0x1003, 1] = code
        values[0x1003, 0] = min(4, values[0x1003, 0] + 1)
        self._tell(0x80 + self.facts.node, code.to_bytes(2, "little") + bytes([memory[0x1001]]) + bytes(5))

    def _leave(self, state: State, cause: str) -> None:
        """Zero the output where the drive is enabled, and go to `state` from where torque could be."""
        if self.state is State.ENABLED and state is not State.ENABLED:
            self.output = 0.0
            self.counters["zeroed"] += 1
            if len(self.zeroings) < _KEPT:
                since = self.time - self._commanded
                self.zeroings.append(Zeroing(self.time, cause, since, self._now - self.time))
        if self.state not in (State.FAULT, State.DISABLED):
            self.state = state

    def _read(self, index: int, sub: int) -> bytes:
        memory = self.memory
        if index == 0x6041:
            memory[index] = statusword_of(self.state)
        elif index == 0x6061:
            memory[index] = memory[0x6060]
        elif index == 0x6064:
            memory[index] = self._position()
        elif index == 0x6077:
            memory[index] = round(self.output / self._volts_per_mille)
        return memory.read(index, sub)

    def _position(self) -> int:
        """Return what the sensor counts, in 32 bits, where counters wrap; a sensor that fails is a fault."""
        position = self.plant.measure() / self.facts.count_size
        if not math.isfinite(position):
            self._fail(SENSOR_FAILED, "position sensor")
            return self.memory[0x6064]
        return (round(position) + (1 << 31)) % (1 << 32) - (1 << 31)

    def _write(self, index: int, sub: int, data: bytes) -> None:
        memory = self.memory
        if index in (0x1400, 0x1600, 0x1800, 0x1A00) and self.nmt == OPERATIONAL:
            raise SdoAbort(sdo.WRONG_STATE)
        if index == 0x6060 and data[:1] not in (b"\0", bytes([PROFILE_TORQUE]), bytes([CYCLIC_TORQUE])):
            raise SdoAbort(sdo.BAD_VALUE)
        value = memory.write(index, sub, data)
        if index == 0x1016 and sub == 1:
            self._fed = math.inf  # monitored from the first heartbeat on
        elif index == 0x1017:
            self._beat = self._now + 1e-3 * value if value else math.inf
        elif index == 0x6040:
            self._obey(value)
        elif index == 0x6071:
            self._commanded = self.time
            self._put_out()


def cia402_side(plant: Plant, stage: Stage) -> SlcanSide:
    """Build the drive in front of a plant, behind an slcan adapter: what a plant server puts on its port."""
    from rtcomp_drivers.slcan_side import SlcanSide

    facts = AxisFacts(
        axis=stage.axis,
        voltage_limit=stage.voltage_limit,
        force_constant=stage.mechanics.force_constant,
        count_exponent=count_exponent(stage.sensor.resolution),
    )
    return SlcanSide(Cia402Axis(plant, facts))
