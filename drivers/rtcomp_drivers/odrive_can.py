"""An ODrive on a CAN bus: torque out, encoder estimates in, by CANSimple; hardware or the plant server."""

from __future__ import annotations

import math
import struct
import time
from typing import TYPE_CHECKING

from rtcomp.errors import ConfigError, DeviceBusyError, DeviceError, DeviceTimeoutError, LimitError
from rtcomp.loop.device import INVALID, OK, STALE, Sample
from rtcomp_drivers import cansimple as c
from rtcomp_drivers.bus_budget import Traffic, check_budget
from rtcomp_drivers.can_link import check_interface
from rtcomp_drivers.cansimple import CLOSED_LOOP, IDLE, Command
from rtcomp_drivers.driver import Bench, Driver, check_volts
from rtcomp_drivers.odrive_link import HEARTBEATS_S, OdriveLink
from rtcomp_drivers.odrive_settings import MOST_TORQUE, OdriveSettings, scales, torque_limit

if TYPE_CHECKING:
    import can

_FLOAT = struct.Struct("<f")
_HEARTBEAT_HZ = 10.0
_COUNTERS = (
    "sent", "samples", "missed", "late", "frozen", "clamped", "damaged", "error_frames",
)  # fmt: skip


class OdriveDriver(Driver):
    """An ODrive's axis in torque control on a CAN bus (CANSimple), or a plant server in its place."""

    name = "odrive-can"
    Settings = OdriveSettings

    def __init__(self, settings: OdriveSettings, bench: Bench) -> None:
        super().__init__(settings, bench)
        self.settings: OdriveSettings = settings
        self.delay_ticks = 1  # a command leaves with the exchange that follows its computation
        self.version: c.Version | None = None
        """The firmware's, once open, where it says one."""
        self.output = 0.0
        """V, the command that was in force when the newest sample was asked for."""
        self.disarmed: bool | None = None
        """After close: whether the axis confirmed that it is idle."""
        check_interface(settings)
        rate = 1.0 / bench.period
        settings.check_watchdog_holds(bench.period)
        if (settings.velocity_limit is None) != (settings.current_limit is None):
            raise ConfigError(
                "device: velocity_limit and current_limit go out in one frame; give both or none"
            )
        self.turn, self.torque_per_volt = scales(settings, bench)
        self.torque_limit = torque_limit(settings, bench, self.torque_per_volt)
        self.bus_load = check_budget(
            [
                Traffic("torque", rate, 8),
                Traffic("request", rate, 0),
                Traffic("position", rate, 8),
                Traffic("heartbeat", _HEARTBEAT_HZ, 8),
            ],
            settings.bitrate,
            rate,
        )
        """Worst share of the bus's bits that the run takes."""
        self._timeout = settings.wait(bench.period)
        self.max_missed = settings.most_missed(bench.period)
        """Positions that may be missing in a row."""
        self._link: OdriveLink | None = None
        self._reset()

    def _reset(self) -> None:
        self.counters = dict.fromkeys(_COUNTERS, 0)
        self.remarks = []
        self.output = 0.0
        self.disarmed = None
        self._began = time.monotonic()
        self._command = 0.0
        self._missed = self._frozen = 0
        self._armed = self._confirmed = self._fresh = False
        self._armed_at = 0.0
        self._asked = 0.0
        self._waiting = False
        """Whether the request of `_asked` has no answer yet."""
        self._seen: bytes | bytearray = b""
        self._last: Sample | None = None

    def open(self) -> None:
        """Open the bus, find the axis, check that it fits the run, prove its watchdog, take a first sample.

        The axis is left idle until the first exchange or `arm`. Raises what CanLink raises,
        DeviceTimeoutError where no heartbeat comes, DeviceBusyError where another master has the axis,
        ProtocolError for another firmware, DeviceError for an axis in error or without watchdog.
        """
        if self._link is not None:
            return
        self._reset()
        s = self.settings
        link = OdriveLink(s, s.node_id, s.firmware)
        try:
            self._find(link)
            self._request: can.Message = link.message(Command.ENCODER_ESTIMATES, None)
            self._torque: can.Message = link.message(Command.INPUT_TORQUE, c.encode_torque(0.0))
            if s.velocity_limit is not None and s.current_limit is not None:
                link.send(Command.LIMITS, c.encode_limits(s.velocity_limit, s.current_limit))
            self._link = link
            self.look()
            self._say_how_fine(link)
            if s.check_watchdog:
                link.prove_watchdog(s.watchdog)
            else:
                self.remarks.append(f"{link.who}: its watchdog was not proven (check_watchdog: false)")
            link.check_alone()
        except BaseException:
            self._link = None
            link.can.close()
            raise
        timer = link.can.latency_timer_ms
        if timer is not None and 1e-3 * timer > self._timeout:
            self.remarks.append(
                f"{link.who}: its adapter's latency timer is {timer} ms; samples will be late"
            )

    def look(self) -> Sample:
        """Return a new sample of the axis as it is, idle: its output stays zero. Raises DeviceError."""
        link = self._link
        if link is None:
            raise self.not_open()
        for _ in range(3):
            self._asked, self._waiting = time.monotonic(), True
            link.can.send(self._request)
            link.estimates = b""
            if link.wait(0.1, lambda: bool(link.estimates)):
                self._estimate(link)
                assert self._last is not None
                return self._last
        raise DeviceTimeoutError(
            f"{link.who}: does not answer a request for its position; does the adapter pass remote frames?"
        )

    def arm(self) -> None:
        """Have the axis close its loop on zero torque; from now on its watchdog runs, fed by `exchange` only.

        Whether it did is seen in its heartbeats and judged in `exchange`.
        """
        link = self._link
        if link is None:
            raise self.not_open()
        link.close_loop()
        self._armed, self._confirmed = True, False
        self._armed_at = time.monotonic()

    def exchange(self, volts: float) -> Sample:
        """Ask for the position, send the torque, return the position that was measured before it acts.

        Where none comes in time, the newest there is comes back with status STALE; more than `max_missed` in
        a row raise DeviceTimeoutError. Errors of the axis, a lost heartbeat, a second master, an emergency
        stop on the bus and a lost interface raise DeviceError, a command that is no finite number LimitError.
        """
        link = self._link
        if link is None:
            raise self.not_open()
        if not -MOST_TORQUE <= volts <= MOST_TORQUE:
            check_volts(self.name, volts)
            raise LimitError(
                f"{self.name}: command is {volts:g} V; allowed is [-{MOST_TORQUE:g}, {MOST_TORQUE:g}]"
            )
        if not self._armed:
            self.arm()
        self._drain(link)
        self._judge(link)
        self._fresh = False
        receive = link.can.receive
        self._asked, self._waiting = time.monotonic(), True
        link.can.send(self._request)
        self.output = self._command
        self._send_torque(link, volts)
        deadline = time.monotonic() + self._timeout
        while not self._fresh:
            message = receive(deadline - time.monotonic())
            if message is None:
                break
            if link.take(message):
                self._estimate(link)
        if self._fresh:
            self._missed = 0
        else:
            self._miss(link)
        self._judge(link)
        assert self._last is not None  # open() took one
        return self._last

    def close(self) -> None:
        """Command zero, go idle, let go of the bus, whatever state it is in.

        Waits for a heartbeat that confirms it; where none does, says so in `disarmed` and `remarks` instead
        of raising.
        """
        link, self._link = self._link, None
        if link is None:
            return
        self.disarmed = self._armed = False
        unsure = "output not confirmed zero, the axis' watchdog must see to it"
        try:
            self.disarmed = link.open_loop()
            if not self.disarmed:
                self.remarks.append(f"{link.who}: no heartbeat says that it is idle; {unsure}")
        except DeviceError as error:
            self.remarks.append(f"{error}; {unsure}")
        finally:
            self.counters["damaged"] = link.damaged + link.can.damaged
            self.counters["error_frames"] = link.can.error_frames
            link.can.close()

    def _find(self, link: OdriveLink) -> None:
        """Find out who is there; refuse an axis that is not ours to have."""
        beat = link.listen(self.settings.connect_timeout)
        state = c.STATES.get(beat.state, f"state {beat.state}")
        if beat.state == CLOSED_LOOP:
            raise DeviceBusyError(
                f"{link.who}: is in {state}: another master has armed it; end that one, or wait for its "
                "watchdog"
            )
        if beat.state != IDLE:
            raise DeviceError(f"{link.who}: is in {state}; wait until it is IDLE")
        self.version = link.check_version()
        self.who = link.who
        # No ODrive is product 0: so the axis of the plant server says that nothing moves.
        self.hardware = self.version is None or self.version.hardware != c.STAND_IN
        if link.faulty:
            self._clear(link)

    def _clear(self, link: OdriveLink) -> None:
        why = link.errors
        expired = c.error_bit("WATCHDOG_TIMER_EXPIRED", link.dialect)
        # The watchdog of 0.5.6 runs while the axis is idle too: every host that ends leaves its error behind.
        usual = link.dialect == "0.5.6" and link.beat.error == expired and not link.beat.parts
        if not (self.settings.clear_fault or usual):
            raise DeviceError(
                f"{link.who}: has an error ({why}); see that the axis may move, then set `clear_fault: true` "
                "in the section device"
            )
        if not link.clear():
            raise DeviceError(f"{link.who}: its error cannot be cleared ({link.errors})")
        if not usual:
            self.remarks.append(f"{link.who}: had an error ({why}), cleared")

    def _say_how_fine(self, link: OdriveLink) -> None:
        """Remark where positions here are coarser than the stage's sensor."""
        assert self._last is not None  # look() took one
        turns = abs(self._last.position / self.turn)
        step = self.turn * 2.0 ** (math.floor(math.log2(max(turns, 1e-6))) - 23)
        finest = self.bench.stage.file.sensor.resolution if self.bench.stage is not None else 0.0
        if finest and step > finest:
            self.remarks.append(
                f"{link.who}: at {turns:.4g} turns its positions, single-precision numbers, are {step:.2g} m "
                f"(rad) apart, coarser than sensor.resolution = {finest:g}; set its position to 0 near here"
            )

    def _send_torque(self, link: OdriveLink, volts: float) -> None:
        torque = volts * self.torque_per_volt
        if abs(torque) > self.torque_limit:
            torque = math.copysign(self.torque_limit, torque)
            self.counters["clamped"] += 1
        self._command = torque / self.torque_per_volt
        _FLOAT.pack_into(self._torque.data, 0, torque)
        link.can.send(self._torque)
        self.counters["sent"] += 1

    def _drain(self, link: OdriveLink) -> None:
        """Take what came since the last exchange: heartbeats, and positions that are late."""
        while (message := link.can.receive(0.0)) is not None:
            if link.take(message):
                self.counters["late"] += 1
                self._estimate(link)

    def _estimate(self, link: OdriveLink) -> None:
        data = link.estimates
        estimates = c.decode_estimates(data)
        assert estimates is not None  # take() saw to the length
        turns, speed = estimates
        # An axis that says it moves and yet stands to the last bit is no measurement.
        stands = data == self._seen and abs(speed) * self.bench.period > 1e-6 * abs(turns) + 1e-7
        self._seen = data
        if stands:
            self.counters["frozen"] += 1
            return
        self._fresh = True
        self.counters["samples"] += 1
        position, status = turns * self.turn, OK
        if not math.isfinite(position):
            position, status = self._last.position if self._last is not None else 0.0, INVALID
        # The axis measures when it is asked; when we get to read the answer is another matter.
        measured = self._asked if self._waiting else time.monotonic()
        self._waiting = False
        self._last = Sample(position, measured - self._began, self.counters["samples"], status)

    def _miss(self, link: OdriveLink) -> None:
        self.counters["missed"] += 1
        self._missed += 1
        if self._missed > self.max_missed:
            raise DeviceTimeoutError(
                f"{link.who}: no position in {self._missed} exchanges in a row (waited "
                f"{1e3 * self._timeout:.3g} ms in each); is it still powered and connected?"
            )
        if self._last is not None and self._last.status == OK:
            self._last = self._last._replace(status=STALE)

    def _judge(self, link: OdriveLink) -> None:
        """Raise what the frames so far say is wrong."""
        if link.estop or link.second_master is not None:
            link.check_alone()
        if link.faulty:
            raise DeviceError(f"{link.who}: has an error ({link.errors}); its output is zero")
        now = time.monotonic()
        if now - link.heard > self.settings.heartbeat_timeout:
            raise DeviceError(
                f"{link.who}: no heartbeat for {now - link.heard:.2g} s; is it still powered and connected?"
            )
        if link.heard <= self._armed_at:
            return
        if link.beat.state == CLOSED_LOOP:
            self._confirmed = True
        elif self._confirmed or now - self._armed_at > max(HEARTBEATS_S, self.settings.heartbeat_timeout):
            state = c.STATES.get(link.beat.state, f"state {link.beat.state}")
            what = "is not armed any more but" if self._confirmed else "does not close its loop; it is"
            raise DeviceError(f"{link.who}: {what} {state}; its output is zero")
