"""A board on a serial line that speaks the protocol of drivers/README.md: hardware or the plant server."""

from __future__ import annotations

import math
import time

from pydantic import Field

from rtcomp.errors import (
    DeviceBusyError,
    DeviceError,
    DeviceTimeoutError,
    LimitError,
    ProtocolError,
)
from rtcomp.loop.device import INVALID, OK, STALE, Sample
from rtcomp_drivers import protocol
from rtcomp_drivers.driver import Bench, Driver, check_volts
from rtcomp_drivers.link_settings import LinkSettings
from rtcomp_drivers.protocol import ARMED, FAULT
from rtcomp_drivers.serial_link import ASK_AGAIN_S, SerialLink

_MASK = 0xFFFFFFFF
_HALF = 1 << 31
_MOST_VOLTS = 1e-6 * ((1 << 31) - 1)
_ROUND_TRIP_BYTES = 48
"""COMMAND and SAMPLE on the line, with coding and delimiters."""
_STAND_INS = ("rtcomp plant", "rtcomp firmware on the host")
"""How what stands in for hardware begins the text of its INFO."""
_COUNTERS = (
    "sent", "unsent", "samples", "missed", "late", "duplicate", "frozen", "clamped", "lagging", "bad_frames",
    "unknown_frames",
)  # fmt: skip


class SerialSettings(LinkSettings):
    """Settings of the driver ``serial``."""

    port: str = Field(min_length=1, description="path of the port, such as /dev/ttyACM0")
    baudrate: int = Field(1_000_000, ge=9600, le=12_000_000, description="means nothing on USB and ptys")
    voltage_limit: float | None = Field(
        None, gt=0.0, le=2000.0, description="V, clamped on the board; without it the stage's"
    )
    connect_timeout: float = Field(3.0, gt=0.0, le=60.0, description="s to wait for a board to answer")


class SerialDriver(Driver):
    """A board on a serial port, or a plant server: binary protocol with CRC, sequence and watchdog."""

    name = "serial"
    Settings = SerialSettings

    def __init__(self, settings: SerialSettings, bench: Bench) -> None:
        super().__init__(settings, bench)
        self.settings: SerialSettings = settings
        self.delay_ticks = 1  # a command leaves with the exchange that follows its computation
        self.info: protocol.Info | None = None
        """What the board says of itself, once open."""
        self.output = 0.0
        """V, what the board put out when it took the newest sample."""
        self.disarmed: bool | None = None
        """After close: whether the board confirmed that its output is zero."""
        settings.check_watchdog_holds(bench.period)
        self._timeout = settings.wait(bench.period)
        self.max_missed = settings.most_missed(bench.period)
        """Samples that may be missing in a row."""
        self._link: SerialLink | None = None
        self._reset()

    def _reset(self) -> None:
        self.counters = dict.fromkeys(_COUNTERS, 0)
        self.remarks = []
        self.output = 0.0
        self.disarmed = None
        self._sequence = 0
        """Of the newest command."""
        self._answered = 0
        """Sequence of the newest sample."""
        self._time_us = -1
        self._missed = 0
        self._count_size = 1.0
        self._armed = False
        self._last: Sample | None = None

    def open(self) -> None:
        """Open the port, find out who is there, check that it fits the run, take a first sample.

        The board stays disarmed, its output zero, until the first exchange or `arm`. Raises DeviceError
        (no such port, no port at all, board unfit or in FAULT), DeviceBusyError, DeviceTimeoutError where
        nothing answers, ProtocolError where something else does.
        """
        if self._link is not None:
            return
        self._reset()
        link = SerialLink(self.settings.port, self.settings.baudrate)
        try:
            self.info = link.hello(self.settings.connect_timeout)
            self._check_fit(link, self.info)
            self._count_size = self.info.count_size
            self.who = link.who
            self.hardware = not self.info.text.startswith(_STAND_INS)
            if self.info.state == FAULT:
                self._clear(link, self.info)
            self._link = link
            self.look()
        except BaseException:
            self._link = None
            link.port.close()
            raise

    def look(self) -> Sample:
        """Return a new sample of the board as it is, disarmed: its output stays zero. Raises DeviceError."""
        link = self._link
        if link is None:
            raise self.not_open()
        seen = self._answered
        for _ in range(3):
            self._send(link, 0)
            end = time.monotonic() + ASK_AGAIN_S
            while self._answered == seen and (left := end - time.monotonic()) > 0.0:
                self._read(link, link.take(left) or [])
            if self._answered != seen:
                break
        else:
            raise DeviceTimeoutError(f"{link.who}: answers, but sent no sample in {3 * ASK_AGAIN_S:.1f} s")
        assert self._last is not None
        return self._last

    def arm(self) -> None:
        """Arm the board; its watchdog runs from now on. The first exchange does it where nobody has."""
        link, info = self._link, self.info
        if link is None or info is None:
            raise self.not_open()
        limit = self.settings.voltage_limit
        if limit is None and self.bench.stage is not None:
            limit = self.bench.stage.voltage_limit
        request = protocol.Arm(
            link.next_tag(),
            watchdog_ms=round(1e3 * self.settings.watchdog),
            voltage_limit_uv=min(
                info.voltage_limit_uv, _MASK if limit is None else max(1, round(1e6 * limit))
            ),
            period_us=max(1, round(1e6 * self.bench.period)),
        )
        reply = link.ask(request)
        if reply.result != protocol.ACCEPTED:
            why = protocol.RESULTS.get(reply.result, f"result {reply.result}")
            state = protocol.STATES.get(reply.state, f"state {reply.state}")
            raise DeviceError(f"{link.who}: refuses to arm: {why} ({state})")
        self._armed = True

    def exchange(self, volts: float) -> Sample:
        """Send a command and return the sample that answers it.

        Where none comes in time, the newest sample there is comes back with status STALE; more than
        `max_missed` in a row raise DeviceTimeoutError. A board that is not armed any more, a failed link
        and a lost port raise DeviceError. A command that no int32 of microvolts holds raises LimitError.
        """
        link = self._link
        if link is None:
            raise self.not_open()
        if not -_MOST_VOLTS <= volts <= _MOST_VOLTS:
            check_volts(self.name, volts)
            raise LimitError(
                f"serial: command is {volts:g} V; allowed is [{-_MOST_VOLTS:g}, {_MOST_VOLTS:g}]"
            )
        if not self._armed:
            self.arm()
        self._send(link, round(1e6 * volts))
        deadline = time.monotonic() + self._timeout
        while self._answered != self._sequence:
            messages = link.take(deadline - time.monotonic())
            if messages is None:
                break
            self._read(link, messages)
        if self._answered == self._sequence:
            self._missed = 0
        else:
            self._miss(link)
        assert self._last is not None  # open() took one
        return self._last

    def close(self) -> None:
        """Command zero, disarm, let go of the port, whatever state it is in.

        Waits for the board to confirm, for that proves that both left the line; where it does not, says so in
        `disarmed` and `remarks` instead of raising.
        """
        link, self._link = self._link, None
        if link is None:
            return
        self.disarmed = self._armed = False
        try:
            link.port.discard_output()
            self._send(link, 0)
            link.ask(protocol.Disarm(link.next_tag()))
            self.disarmed = True
        except DeviceError as error:
            self.remarks.append(f"{error}; output not confirmed zero, the board's watchdog must see to it")
        finally:
            self.counters["bad_frames"] = link.decoder.bad
            self.counters["unknown_frames"] = link.decoder.unknown
            link.port.close()

    def _send(self, link: SerialLink, microvolts: int) -> None:
        self._sequence += 1
        self.counters["sent"] += 1
        if not link.port.write(protocol.encode_command(self._sequence & _MASK, microvolts)):
            self.counters["unsent"] += 1

    def _read(self, link: SerialLink, messages: list[protocol.Message]) -> None:
        for message in messages:
            if isinstance(message, protocol.Measured):
                self._measured(link, message)
            elif isinstance(message, protocol.Fault):
                raise DeviceError(f"{link.who}: went into FAULT ({message.text})")

    def _measured(self, link: SerialLink, message: protocol.Measured) -> None:
        behind = (self._sequence - message.sequence) & _MASK
        number = self._sequence - behind
        if behind >= _HALF or number <= self._answered:
            self.counters["duplicate"] += 1  # seen before, overtaken by a newer one, or never asked for
            return
        if self._armed and message.state != ARMED:
            state = protocol.STATES.get(message.state, f"in state {message.state}")
            raise DeviceError(f"{link.who}: is not armed any more but {state}; its output is zero")
        if message.time_us <= self._time_us:
            self.counters["frozen"] += 1  # bytes are valid, but the board's clock stands
            return
        self._answered = number
        self._time_us = message.time_us
        self.counters["samples"] += 1
        self.counters["late"] += behind > 0
        self.counters["clamped"] += bool(message.flags & protocol.CLAMPED)
        self.counters["lagging"] += bool(message.flags & protocol.LAGGING)
        self.output = message.output_uv / 1e6
        position, status = message.position * self._count_size, OK
        if message.flags & protocol.POSITION_INVALID:
            position, status = self._last.position if self._last is not None else 0.0, INVALID
        self._last = Sample(position, 1e-6 * message.time_us, number, status)

    def _miss(self, link: SerialLink) -> None:
        self.counters["missed"] += 1
        self._missed += 1
        if self._missed > self.max_missed:
            raise DeviceTimeoutError(
                f"{link.who}: no sample in {self._missed} exchanges in a row (waited "
                f"{1e3 * self._timeout:.3g} ms in each); is it still powered and connected?"
            )
        if self._last is not None and self._last.status == OK:
            self._last = self._last._replace(status=STALE)

    def _check_fit(self, link: SerialLink, info: protocol.Info) -> None:
        """Refuse a board that cannot serve this run."""
        stage, period = self.bench.stage, self.bench.period
        axis = protocol.AXES.get(info.axis, f"of kind {info.axis}")
        if info.state == ARMED:
            raise DeviceBusyError(
                f"{link.who}: is armed by another host; end that host, or wait for the watchdog"
            )
        if stage is not None and axis != stage.axis:
            raise DeviceError(
                f"{link.who}: its axis is {axis}, the stage's is {stage.axis}; is this its port?"
            )
        if not (info.count_size > 0.0 and math.isfinite(info.count_size)):
            raise ProtocolError(
                f"{link.who}: a position count of {info.count_size} m; it must be more than 0"
            )
        if period * info.max_rate_hz < 1.0 - 1e-9:
            most = info.max_rate_hz
            raise DeviceError(f"{link.who}: takes at most {most} Hz, the loop wants {1.0 / period:g} Hz")
        wire = 10.0 * _ROUND_TRIP_BYTES / self.settings.baudrate
        if link.port.has_wire and wire > self._timeout:
            raise DeviceError(
                f"{link.who}: at {self.settings.baudrate} baud command and sample take {1e3 * wire:.3g} ms "
                f"of the {1e3 * self._timeout:.3g} ms there are; raise baudrate or lower the rate"
            )
        timer = link.port.latency_timer_ms
        if timer is not None and 1e-3 * timer > self._timeout:
            self.remarks.append(
                f"{link.who}: its adapter's latency timer is {timer} ms; samples will be late"
            )

    def _clear(self, link: SerialLink, info: protocol.Info) -> None:
        why = protocol.FAULTS.get(info.fault, f"fault {info.fault}")
        if not self.settings.clear_fault:
            raise DeviceError(
                f"{link.who}: is in FAULT ({why}); see that the axis may move, then set `clear_fault: true` "
                "in the section device"
            )
        reply = link.ask(protocol.Clear(link.next_tag()))
        if reply.result != protocol.ACCEPTED or reply.state == FAULT:
            raise DeviceError(f"{link.who}: its fault cannot be cleared ({why}); switch it off and on")
        self.remarks.append(f"{link.who}: was in FAULT ({why}), cleared")
