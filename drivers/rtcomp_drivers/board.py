"""What a board does, as a pure state machine: bytes and time in, bytes and volts out.

This is the device side of the serial protocol (drivers/README.md) around any plant that can be advanced
and measured. It has no port and no clock, so that it runs in virtual time under test and in real time in
the plant server alike.

States: DISARMED -- ARM --> ARMED -- watchdog, bad link, bad sensor --> FAULT (latched) -- CLEAR --> DISARMED.
The output is zero in every state but ARMED.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from rtcomp_drivers import protocol
from rtcomp_drivers.protocol import ARMED, DISARMED, FAULT
from rtcomp_drivers.quality import LinkQuality

if TYPE_CHECKING:
    from rtcomp.stage.stage import Stage

MAX_WATCHDOG_MS = 10_000
_HALF = 1 << 31
_MASK = 0xFFFFFFFF
_COUNTS = 1 << 63
_COUNTERS = (
    "commands", "discarded", "superseded", "ignored", "clamped", "watchdog_trips", "link_faults", "zeroed",
)  # fmt: skip
_KEPT = 1000
"""Most zeroings that are remembered one by one."""


class Plant(Protocol):
    """What hangs on the board's output and sensor; rtcomp.stage's Simulator is one."""

    def advance(self, volts: float, seconds: float) -> None:
        """Let `seconds` pass with `volts` held."""

    def measure(self) -> float:
        """Run the position sensor once (m, rad)."""


class BoardFacts(NamedTuple):
    """What the board says of itself in INFO."""

    axis: str = "linear"
    voltage_limit: float = 10.0
    """V, the board's own; ARM can only lower it."""
    max_rate_hz: int = 20_000
    count_size: float = 1e-12
    """m (rad) per position count."""
    text: str = "rtcomp plant"


class Zeroing(NamedTuple):
    """One end of an armed stretch: from here on the output is zero."""

    time: float
    """s, board clock, at which the output went to zero."""
    cause: str
    since_command: float
    """s since the last command that was acted on."""
    noticed_after: float
    """s from `time` until the board was given the processor to act on it; 0 on a real timer."""


class Board:
    """The board; call `receive` when bytes come and `run_until` whenever time has passed."""

    def __init__(self, plant: Plant, facts: BoardFacts | None = None) -> None:
        self.plant = plant
        self.facts = facts or BoardFacts()
        self.time = 0.0
        """s, board clock: how far the plant has been run."""
        self.state = DISARMED
        self.fault = protocol.NO_FAULT
        self.output_uv = 0
        """What the plant gets, microvolts."""
        self.lagging = False
        """Set by whoever runs the board where it cannot keep up; travels in every sample."""
        self.zeroings: list[Zeroing] = []
        self.counters = dict.fromkeys(_COUNTERS, 0)
        self.decoder = protocol.Decoder()
        self._quality = LinkQuality()
        self._own_limit_uv = round(1e6 * self.facts.voltage_limit)
        self._sequence = 0
        self._limit_uv = 0
        self._watchdog = 0.0
        self._fed = 0.0
        self._arm: protocol.Arm | None = None
        self._handlers: dict[type[Any], Callable[[Any], bytes]] = {
            protocol.Hello: self._hello,
            protocol.Arm: self._armed,
            protocol.Disarm: self._disarm,
            protocol.Clear: self._clear,
        }

    @property
    def output(self) -> float:
        """V, what the plant gets."""
        return self.output_uv / 1e6

    def run_until(self, now: float) -> bytes:
        """Let time pass to `now` (s, board clock); return frames that the board sends by itself.

        The watchdog acts at its own instant, not when it is looked at: the plant is run with the old
        output up to there and with zero from there.
        """
        sent = b""
        if self.state == ARMED and now >= self._fed + self._watchdog:
            self._pass_time(self._fed + self._watchdog)
            self.counters["watchdog_trips"] += 1
            sent = self._fail(protocol.WATCHDOG, now)
        self._pass_time(now)
        return sent

    def receive(self, data: bytes, now: float) -> bytes:
        """Take bytes from the host that arrived at `now` and return the frames to send back.

        Of several commands that arrive together only the newest is acted on and answered: after a stall
        of the link the old ones are history.
        """
        sent = [self.run_until(now)]
        good, bad = self.decoder.good, self.decoder.bad
        pending: protocol.Command | None = None
        for message in self.decoder.feed(data):
            if isinstance(message, protocol.Command):
                if not 0 < ((message.sequence - self._sequence) & _MASK) < _HALF:
                    self.counters["discarded"] += 1  # a duplicate, or older than one already seen
                    continue
                self.counters["superseded"] += pending is not None
                self._sequence = message.sequence
                pending = message
                continue
            if pending is not None:
                sent.append(self._command(pending, now))
                pending = None
            handler = self._handlers.get(type(message))
            if handler is not None:  # a frame meant for a host is none of the board's business
                sent.append(handler(message))
        if pending is not None:
            sent.append(self._command(pending, now))
        good, bad = self.decoder.good - good, self.decoder.bad - bad
        if (good or bad) and self._quality.too_bad(good, bad, now) and self.state == ARMED:
            self.counters["link_faults"] += 1
            sent.append(self._fail(protocol.LINK, now))
        return b"".join(sent)

    def shut_down(self, now: float) -> None:
        """Zero the output because the board itself ends."""
        self.run_until(now)
        if self.state == ARMED:
            self._zero("shut down", now)
            self.state = DISARMED

    def summary(self) -> dict[str, Any]:
        """Return what happened, for a log; times in s on the board's clock."""
        return {
            "frames": self.decoder.good,
            "bad_frames": self.decoder.bad,
            "unknown_frames": self.decoder.unknown,
            **self.counters,
            "zeroings": [z._asdict() for z in self.zeroings],
        }

    def _pass_time(self, until: float) -> None:
        seconds = until - self.time
        if seconds > 0.0:
            self.plant.advance(self.output, seconds)
            self.time = until

    def _command(self, command: protocol.Command, now: float) -> bytes:
        before = self.output_uv
        position, flags = self._measure()
        self.counters["commands"] += 1
        failed = b""
        if self.state != ARMED:
            flags |= protocol.IGNORED
            self.counters["ignored"] += 1
        elif flags & protocol.POSITION_INVALID:
            failed = self._fail(protocol.SENSOR, now)
        else:
            self.output_uv = min(max(command.voltage_uv, -self._limit_uv), self._limit_uv)
            if self.output_uv != command.voltage_uv:
                flags |= protocol.CLAMPED
                self.counters["clamped"] += 1
            self._fed = now
        if self.lagging:
            flags |= protocol.LAGGING
        time_us = round(1e6 * self.time)
        sample = protocol.Measured(command.sequence, time_us, position, before, flags, self.state)
        return protocol.encode(sample) + failed

    def _measure(self) -> tuple[int, int]:
        position = self.plant.measure() / self.facts.count_size
        if not math.isfinite(position) or abs(position) >= _COUNTS:
            return 0, protocol.POSITION_INVALID
        return round(position), 0

    def _hello(self, message: protocol.Hello) -> bytes:
        if self.state != ARMED:  # a new session; one that is running is not disturbed
            self._sequence = 0
        facts = self.facts
        axis = next(code for code, name in protocol.AXES.items() if name == facts.axis)
        info = protocol.Info(
            message.tag, protocol.VERSION, axis, self.state, self.fault, facts.max_rate_hz,
            self._own_limit_uv, facts.count_size, facts.text,
        )  # fmt: skip
        return protocol.encode(info)

    def _armed(self, message: protocol.Arm) -> bytes:
        if self.state == ARMED and message == self._arm:  # the same request again: its reply was lost
            return self._reply(message.tag, protocol.ACCEPTED)
        if self.state != DISARMED:
            return self._reply(message.tag, protocol.WRONG_STATE)
        good = (
            0 < message.watchdog_ms <= MAX_WATCHDOG_MS
            and message.voltage_limit_uv > 0
            and message.period_us > 0
            and 1e6 / message.period_us <= self.facts.max_rate_hz
        )
        if not good:
            return self._reply(message.tag, protocol.BAD_PARAMETER)
        self._arm = message
        self._limit_uv = min(message.voltage_limit_uv, self._own_limit_uv)
        self._watchdog = 1e-3 * message.watchdog_ms
        self._fed = self.time
        self.state = ARMED
        return self._reply(message.tag, protocol.ACCEPTED)

    def _disarm(self, message: protocol.Disarm) -> bytes:
        if self.state == ARMED:
            self._zero("disarmed", self.time)
            self.state = DISARMED
        return self._reply(message.tag, protocol.ACCEPTED)

    def _clear(self, message: protocol.Clear) -> bytes:
        if self.state == ARMED:
            return self._reply(message.tag, protocol.WRONG_STATE)
        self.state, self.fault = DISARMED, protocol.NO_FAULT
        return self._reply(message.tag, protocol.ACCEPTED)

    def _reply(self, tag: int, result: int) -> bytes:
        return protocol.encode(protocol.Reply(tag, result, self.state, self.fault))

    def _fail(self, fault: int, now: float) -> bytes:
        self._zero(protocol.FAULTS[fault].split(":")[0], now)
        self.state, self.fault = FAULT, fault
        return protocol.encode(protocol.Fault(fault, round(1e6 * self.time), protocol.FAULTS[fault]))

    def _zero(self, cause: str, now: float) -> None:
        self.output_uv = 0
        self._arm = None
        self.counters["zeroed"] += 1
        if len(self.zeroings) < _KEPT:
            self.zeroings.append(Zeroing(self.time, cause, self.time - self._fed, now - self.time))


def board_side(plant: Plant, stage: Stage) -> Board:
    """Build the board in front of a plant, with the stage's axis and voltage limit."""
    return Board(
        plant, BoardFacts(axis=stage.axis, voltage_limit=stage.voltage_limit, text="rtcomp plant server")
    )
