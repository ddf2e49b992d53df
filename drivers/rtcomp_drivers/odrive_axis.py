"""An ODrive's axis as a pure state machine: frames and time in, frames and torque out.

The device's side of CANSimple (rtcomp_drivers.cansimple) in torque control around any plant that can be
advanced and measured; no bus, no clock. States IDLE and CLOSED_LOOP_CONTROL; the torque is zero in every
state but the second, and an error leads to IDLE until it is cleared. As in ODrive's firmware every frame to
the node feeds the watchdog, which in 0.6 runs while the loop is closed, in 0.5.6 always.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from rtcomp_drivers import cansimple as c
from rtcomp_drivers.board import Plant, Zeroing
from rtcomp_drivers.cansimple import CLOSED_LOOP, IDLE, Command
from rtcomp_drivers.slcan import Frame
from rtcomp_drivers.slcan_side import SlcanSide

if TYPE_CHECKING:
    from rtcomp.stage.stage import Stage

LEAD = 1e-3
"""m that a linear stage moves in a turn of the plant server's motor."""
_KEPT = 1000
"""Most zeroings that are remembered one by one."""
_COUNTERS = (
    "commands", "polls", "ignored", "unknown", "clamped", "refused", "watchdog_trips", "estops", "zeroed",
)  # fmt: skip
_INPUT_ERROR = {"0.6": "MISSING_INPUT", "0.5.6": "CONTROLLER_FAILED"}


class AxisFacts(NamedTuple):
    """How the axis is set up, as with odrivetool."""

    node: int = 0
    dialect: str = "0.6"
    firmware: tuple[int, int, int] = (0, 6, 10)
    watchdog: float | None = 0.1
    """s without a frame until the output is zeroed; None where it is not enabled."""
    heartbeat: float = 0.1
    """s between heartbeats."""
    estimates: float | None = None
    """s between encoder estimates sent unasked; None for none."""
    turn: float = 2.0 * math.pi
    """m (rad) that the plant moves in a turn of the motor."""
    volts_per_torque: float = 1.0
    """V of the plant's command for each Nm."""
    torque_limit: float = 1.0
    """Nm."""


class OdriveAxis:
    """The axis; call `receive` when frames come and `run_until` whenever time has passed."""

    def __init__(self, plant: Plant, facts: AxisFacts | None = None) -> None:
        self.plant = plant
        self.facts = facts or AxisFacts()
        self.time = 0.0
        """s: how far the plant has been run."""
        self.state = IDLE
        self.error = 0
        """Active errors, bits of `cansimple.ERRORS`."""
        self.reason = 0
        """The errors that disarmed it last; cleared with them."""
        self.result = 0
        self.mode = (3, c.PASSTHROUGH)  # position control, as from the factory
        self.input_torque = 0.0
        """Nm, as commanded; kept from before the loop was closed, as in the firmware."""
        self.limits: tuple[float, float] | None = None
        """turns/s and A, as set over the bus."""
        self.zeroings: list[Zeroing] = []
        self.counters = dict.fromkeys(_COUNTERS, 0)
        self._fed = 0.0
        self._next_heartbeat = self.facts.heartbeat
        self._next_estimates = self.facts.estimates or math.inf
        self._seen: tuple[float, float] | None = None
        self._handlers: dict[int, Callable[[bytes, float], None]] = {
            Command.AXIS_STATE: self._axis_state,
            Command.CONTROLLER_MODE: self._controller_mode,
            Command.INPUT_TORQUE: self._set_torque,
            Command.LIMITS: self._set_limits,
            Command.ESTOP: self._estop,
            Command.CLEAR_ERRORS: self._clear,
        }

    @property
    def torque(self) -> float:
        """Nm, what the plant gets."""
        acts = self.state == CLOSED_LOOP and self.mode == (c.TORQUE_CONTROL, c.PASSTHROUGH)
        return self.input_torque if acts else 0.0

    def run_until(self, now: float) -> list[Frame]:
        """Let time pass to `now` (s); return what the axis sends by itself.

        The watchdog acts at its own instant, not when it is looked at.
        """
        self._watch(now)
        self._pass_time(now)
        sent = []
        if now >= self._next_heartbeat:
            self._next_heartbeat = _after(self._next_heartbeat, self.facts.heartbeat, now)
            sent.append(self._frame(Command.HEARTBEAT, self._heartbeat()))
        if now >= self._next_estimates and self.facts.estimates:
            self._next_estimates = _after(self._next_estimates, self.facts.estimates, now)
            sent.append(self._frame(Command.ENCODER_ESTIMATES, self._estimates()))
        return sent

    def receive(self, frames: Sequence[Frame], now: float) -> list[Frame]:
        """Take frames that arrived at `now` (s), in their order; return those that it sends."""
        sent = self.run_until(now)
        for frame in frames:
            if frame.extended or frame.identifier >> 5 != self.facts.node:
                continue
            self._fed = now
            command = frame.identifier & 0x1F
            if frame.remote:
                sent += self._answer(command)
            elif command in self._handlers:
                self._handlers[command](frame.data, now)
            else:
                self.counters["unknown"] += 1
        return sent

    def shut_down(self, now: float) -> None:
        """Zero the output because the axis itself ends."""
        self.run_until(now)
        self._to_idle("shut down", now)

    def summary(self) -> dict[str, Any]:
        """Return what happened, for a log; times in s on the axis' clock."""
        return {
            **self.counters,
            "state": c.STATES[self.state],
            "error": c.error_names(self.error, self.facts.dialect),
            "zeroings": [z._asdict() for z in self.zeroings],
        }

    def _watch(self, now: float) -> None:
        watchdog = self.facts.watchdog
        if watchdog is None or now < self._fed + watchdog:
            return
        expired = c.error_bit("WATCHDOG_TIMER_EXPIRED", self.facts.dialect)
        if self.state == CLOSED_LOOP or (self.facts.dialect == "0.5.6" and not self.error & expired):
            self._pass_time(self._fed + watchdog)
            self.counters["watchdog_trips"] += 1
            self._fail("WATCHDOG_TIMER_EXPIRED", now, "watchdog")

    def _pass_time(self, until: float) -> None:
        seconds = until - self.time
        if seconds > 0.0:
            self.plant.advance(self.torque * self.facts.volts_per_torque, seconds)
            self.time = until

    def _answer(self, command: int) -> list[Frame]:
        """Answer a remote frame; what the dialect does not know it does not answer."""
        new = self.facts.dialect == "0.6"
        self.counters["polls"] += 1
        if command == Command.ENCODER_ESTIMATES:
            return [self._frame(command, self._estimates())]
        if command == Command.VERSION and new:
            version = c.Version(2, c.STAND_IN, self.facts.firmware)
            return [self._frame(command, c.encode_version(version))]
        if command == Command.ERROR and new:
            return [self._frame(command, c.encode_error(self.error, self.reason))]
        return []

    def _estimates(self) -> bytes:
        """Measure; the speed is the mean since the last measurement."""
        turns = self.plant.measure() / self.facts.turn
        before, self._seen = self._seen, (self.time, turns)
        speed = 0.0
        if before is not None and self.time > before[0]:
            speed = (turns - before[1]) / (self.time - before[0])
        return c.encode_estimates(turns, speed)

    def _heartbeat(self) -> bytes:
        return c.encode_heartbeat(c.Heartbeat(self.error, self.state, self.result), self.facts.dialect)

    def _axis_state(self, data: bytes, now: float) -> None:
        wanted = c.decode_number(data)
        if wanted == IDLE:
            self.result = 0
            self._to_idle("disarmed", now)
        elif wanted == CLOSED_LOOP and not self.error and self.mode == (c.TORQUE_CONTROL, c.PASSTHROUGH):
            self.result = 0
            self.state = CLOSED_LOOP
        else:  # cannot close its loop with an error, or does none of what is asked (calibration, other modes)
            self.counters["refused"] += 1
            if self.facts.dialect == "0.6":
                self.result = c.INVALID_STATE_RESULT
            else:
                self._fail("INVALID_STATE", now, "invalid state")

    def _controller_mode(self, data: bytes, _now: float) -> None:
        mode = c.decode_two_numbers(data)
        if mode is None:
            self.counters["ignored"] += 1
        else:
            self.mode = mode

    def _set_torque(self, data: bytes, now: float) -> None:
        torque = c.decode_torque(data)
        if torque is None:
            self.counters["ignored"] += 1
            return
        self.counters["commands"] += 1
        if not math.isfinite(torque):
            self.input_torque = 0.0
            self._fail(_INPUT_ERROR[self.facts.dialect], now, "input")
            return
        most = self.facts.torque_limit
        self.counters["clamped"] += abs(torque) > most
        self.input_torque = min(max(torque, -most), most)

    def _set_limits(self, data: bytes, _now: float) -> None:
        limits = c.decode_estimates(data)
        if limits is None or not all(math.isfinite(x) and x > 0.0 for x in limits):
            self.counters["ignored"] += 1
        else:
            self.limits = limits

    def _estop(self, _data: bytes, now: float) -> None:
        self.counters["estops"] += 1
        self._fail("ESTOP_REQUESTED", now, "emergency stop")

    def _clear(self, _data: bytes, _now: float) -> None:
        self.error = self.reason = self.result = 0

    def _fail(self, name: str, now: float, cause: str) -> None:
        self.error |= c.error_bit(name, self.facts.dialect)
        if self.state == CLOSED_LOOP:
            self.reason = self.error
        self._to_idle(cause, now)

    def _to_idle(self, cause: str, now: float) -> None:
        if self.state != CLOSED_LOOP:
            return
        self.state = IDLE
        self.counters["zeroed"] += 1
        if len(self.zeroings) < _KEPT:
            self.zeroings.append(Zeroing(self.time, cause, self.time - self._fed, now - self.time))

    def _frame(self, command: int, data: bytes) -> Frame:
        return Frame(c.identifier(self.facts.node, command), data)


def _after(due: float, period: float, now: float) -> float:
    """Return the next time on the grid after `now`; those missed are not made up for."""
    return due + period * (math.floor((now - due) / period) + 1)


def odrive_side(plant: Plant, stage: Stage, watchdog: float = 0.1) -> SlcanSide:
    """Build an ODrive whose motor moves `stage`, on a bus at 1 Mbit/s behind an slcan adapter.

    A linear stage moves 1 mm a turn, through a screw without losses: 1 Nm makes 2 pi / lead N. What drives
    the stage's model is the voltage that gives this force. `watchdog` in s.
    """
    turn = LEAD if stage.axis == "linear" else 2.0 * math.pi
    volts_per_torque = 2.0 * math.pi / turn / stage.force_constant
    facts = AxisFacts(
        watchdog=watchdog,
        turn=turn,
        volts_per_torque=volts_per_torque,
        torque_limit=stage.voltage_limit / abs(volts_per_torque),
    )
    return SlcanSide(OdriveAxis(plant, facts))
