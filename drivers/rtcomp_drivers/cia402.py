"""A CiA 402 drive in torque mode on a CANopen bus: hardware, or a plant server behind an slcan adapter.

Set-up by SDO is canopen's (rtcomp_drivers.cia402_setup). In the loop three frames go by hand, in this thread
(rtcomp_drivers.cia402_talk), and now and then the host's heartbeat, only ever with a command.
"""

from __future__ import annotations

import contextlib
import math
import time
from typing import TYPE_CHECKING, Any

from rtcomp.errors import DeviceBusyError, DeviceError, DeviceTimeoutError
from rtcomp.loop.device import OK, STALE, Sample
from rtcomp_drivers.can_link import CanLink, check_interface
from rtcomp_drivers.cia402_objects import STAND_IN
from rtcomp_drivers.cia402_settings import Cia402Settings
from rtcomp_drivers.cia402_states import (
    DISABLE_VOLTAGE,
    ENABLE,
    FAULT_RESET,
    State,
    error_name,
    state_of,
    toward_enabled,
)
from rtcomp_drivers.driver import Bench, Driver, check_volts

if TYPE_CHECKING:
    from rtcomp_drivers.cia402_fit import Fit
    from rtcomp_drivers.cia402_setup import Drive
    from rtcomp_drivers.cia402_talk import Talk

_START, _PRE_OPERATIONAL = 1, 128
_LISTEN_S = 0.1
"""s that the bus is listened to before anything is sent: another master would be heard."""
_PINGS = 5
_FAULTS = (State.FAULT, State.FAULT_REACTION)
_COUNTERS = (
    "sent", "samples", "missed", "late", "duplicate", "clamped", "bad_frames", "other_frames", "warnings",
)  # fmt: skip


class Cia402Driver(Driver):
    """A CANopen drive in torque mode (CiA 402): SYNC, PDOs, state machine, heartbeats, emergencies."""

    name = "cia402"
    Settings = Cia402Settings

    def __init__(self, settings: Cia402Settings, bench: Bench) -> None:
        super().__init__(settings, bench)
        self.settings: Cia402Settings = settings
        self.delay_ticks = 1  # a command leaves with the exchange that follows its computation
        self.output = 0.0
        """V that the newest command stands for, after rounding and limits."""
        self.disarmed: bool | None = None
        """After close: whether the drive confirmed that it is not enabled any more."""
        self.bus_load = settings.check(bench.period)
        """Worst share of the bus that the loop's frames take."""
        self._timeout = settings.wait(bench.period)
        self.max_missed = settings.most_missed(bench.period)
        """Samples that may be missing in a row."""
        self._beat_every = settings.beat_every(bench.period)
        self._beat_patience = 3e-3 * settings.heartbeat_ms + self._timeout
        check_interface(settings)
        self._dictionary = self._load_eds()
        self._talk: Talk | None = None
        self._drive: Drive | None = None
        self._reset()

    def _reset(self) -> None:
        self.counters = dict.fromkeys(_COUNTERS, 0)
        self.remarks = []
        self.output = 0.0
        self.disarmed = None
        self._per_mille = 1.0
        self._limit = 0
        self._missed = 0
        self._taken = False
        self._fit: Fit | None = None

    @property
    def state(self) -> State | None:
        """The drive's state as far as known; None where it is not open."""
        return None if self._talk is None else self._talk.state

    def open(self) -> None:
        """Open the bus, find the drive, check that it fits the run, set it up, take a first sample.

        The drive stays without torque, not enabled, until the first exchange or `arm`. Raises DeviceError
        (no such interface, drive unfit or in fault), DeviceBusyError (another master), DeviceTimeoutError
        where nothing answers, ProtocolError where something else does, ConfigError where units disagree.
        """
        if self._talk is not None:
            return
        from rtcomp_drivers.cia402_setup import Drive
        from rtcomp_drivers.cia402_talk import Talk

        self._reset()
        link = CanLink(self.settings)
        talk = Talk(link, self.settings, self.counters)
        self._drive = Drive(link, self.settings.node, self._dictionary, talk.hear)
        try:
            self._take(talk, self._drive)
        except BaseException:
            self._give_back(talk)
            raise
        self._talk = talk

    def look(self) -> Sample:
        """Return a new sample of the drive as it is, not enabled: no torque. Raises DeviceError."""
        talk = self._talk
        if talk is None:
            raise self.not_open()
        end = time.monotonic() + self.settings.connect_timeout
        while not talk.step(DISABLE_VOLTAGE):
            if time.monotonic() > end:
                raise DeviceTimeoutError(f"{talk.who}: does not answer SYNC; is it still powered?")
        assert talk.last is not None  # that answer was one
        return talk.last

    def arm(self) -> None:
        """Enable the drive at zero torque; its watchdog runs from now on. The first exchange does it else."""
        talk, drive = self._talk, self._drive
        if talk is None or drive is None:
            raise self.not_open()
        patience = self.settings.connect_timeout
        end = time.monotonic() + patience
        while True:
            talk.beat()
            answered = talk.step(toward_enabled(talk.state))
            if answered and talk.state is State.ENABLED:
                break
            if talk.state in _FAULTS:
                raise DeviceError(f"{drive.who}: went into fault while being enabled: {talk.why()}")
            if time.monotonic() > end:
                says = "no known state" if talk.state is None else f"'{talk.state.value}'"
                where = f"stays in {says}" if answered else "does not answer SYNC"
                raise DeviceTimeoutError(
                    f"{drive.who}: {where} for {patience:g} s and is not enabled; is its power stage "
                    "supplied, is safe torque off released?"
                )
        talk.heard_beat = time.monotonic()
        talk.armed = True

    def exchange(self, volts: float) -> Sample:
        """Send a command and SYNC; return the sample that the drive took at that SYNC.

        Where none comes in time, the newest sample there is comes back with status STALE; more than
        `max_missed` in a row raise DeviceTimeoutError. A drive that is not enabled any more, an emergency,
        a lost heartbeat, another master and a lost bus raise DeviceError.
        """
        talk = self._talk
        if talk is None:
            raise self.not_open()
        if not math.isfinite(volts):
            check_volts(self.name, volts)
        if talk.failure is not None:
            raise talk.failure
        if not talk.armed:
            self.arm()
        torque, limit = volts * self._per_mille, self._limit
        if not -limit <= torque <= limit:
            torque = limit if torque > 0.0 else -limit
            self.counters["clamped"] += 1
        talk.drain()  # what is left belongs to SYNCs of the past
        whole = round(torque)
        talk.send(ENABLE, whole)
        self.output = whole / self._per_mille
        if talk.sequence % self._beat_every == 0:
            talk.beat()
        if talk.wait(talk.synced + self._timeout):
            self._missed = 0
        else:
            self._miss(talk)
        if talk.synced - talk.heard_beat > self._beat_patience:
            raise DeviceTimeoutError(
                f"{talk.who}: its heartbeat was lost (none for {1e3 * self._beat_patience:.0f} ms); is it on?"
            )
        assert talk.last is not None  # open() took one
        return talk.last

    def close(self) -> None:
        """Command zero torque, disable the drive, take it out of the loop's traffic, let go of the bus.

        Waits for the drive to confirm; where it does not, says so in `disarmed` and `remarks` instead of
        raising.
        """
        talk, self._talk = self._talk, None
        if talk is None:
            return
        self.disarmed = talk.armed = False
        try:
            self.disarmed = self._disable(talk)
        except DeviceError as error:
            self.remarks.append(f"{error}; not confirmed disabled, the drive's watchdog must see to it")
        finally:
            self._give_back(talk)

    def _load_eds(self) -> Any:
        from rtcomp_drivers.cia402_setup import RATED_TORQUE, WATCHDOG, load_eds

        further = {}
        if self.settings.drive_watchdog:
            further[WATCHDOG] = (
                "the drive cannot watch over this program's heartbeat; set drive_watchdog: false only where "
                "something else takes its torque away"
            )
        if self.settings.rated_torque is None:
            further[RATED_TORQUE] = "set rated_torque"
        return load_eds(self.settings.eds, self.settings.node, further)

    def _take(self, talk: Talk, drive: Drive) -> None:
        """Find out who is there; from where it is certain that nobody else has it, set it up."""
        from rtcomp_drivers.cia402_fit import check_profile, configure, fit

        settings = self.settings
        drive.listen(_LISTEN_S)
        try:
            device_type = drive.read(0x1000)
        except DeviceTimeoutError:
            raise self._nobody(talk, drive) from None
        check_profile(drive, device_type)
        if drive.has(0x1008):
            with contextlib.suppress(DeviceError):  # a drive without a name
                named = drive.text(0x1008)
                drive.who += f" ({named})"
                self.hardware = not named.startswith(STAND_IN)
                talk.who = drive.who
        self.who = drive.who
        talk.why = lambda: self._reason(talk, drive)
        if state_of(drive.read(0x6041)) is State.ENABLED:
            raise DeviceBusyError(
                f"{drive.who}: is enabled by another master; end that one, or wait for the drive's watchdog"
            )
        self._taken = True
        drive.command(_PRE_OPERATIONAL)
        found = self._fit = fit(drive, settings, self.bench)
        configure(drive, settings, self.bench, found)
        self._per_mille, self._limit, talk.count_size = found.per_mille, found.limit, found.count_size
        drive.command(_START)
        self._first_samples(talk, drive)
        if talk.state in _FAULTS:
            self._clear(talk, drive)
        self.remarks += found.remarks
        timer = talk.link.latency_timer_ms
        if timer is not None and 1e-3 * timer > self._timeout:
            self.remarks.append(
                f"{drive.who}: its adapter's latency timer is {timer} ms; samples will be late"
            )

    def _nobody(self, talk: Talk, drive: Drive) -> DeviceTimeoutError:
        others = drive.others()
        doubt = "" if others else talk.link.doubt
        hint = f"nodes that do: {', '.join(map(str, others))}" if others else "nor does any other node"
        return DeviceTimeoutError(
            f"{drive.who}: does not answer at {self.settings.bitrate} bit/s, {hint}; check node, bit rate, "
            f"power and termination{doubt}"
        )

    def _reason(self, talk: Talk, drive: Drive) -> str:
        """Return what the drive says about its fault: its emergency message, else 603Fh."""
        if talk.emergency is not None or not drive.has(0x603F):
            return talk.says_emergency()
        try:
            return error_name(drive.read(0x603F))
        except DeviceError:
            return "its error code could not be read"

    def _first_samples(self, talk: Talk, drive: Drive) -> None:
        """Have a sample before anything depends on one, and know that they come fast enough.

        A busy computer delays some of them, a slow link all: it is too slow if none comes in time.
        """
        times: list[float] = []
        end = time.monotonic() + self.settings.connect_timeout
        while (len(times) < _PINGS or min(times) > self._timeout) and time.monotonic() < end:
            if talk.step(DISABLE_VOLTAGE):
                times.append(time.monotonic() - talk.synced)
        if not times:
            raise DeviceTimeoutError(
                f"{drive.who}: answers SDO, but not SYNC: no TPDO ({0x180 + drive.node:03X}h) comes"
            )
        if min(times) > self._timeout:
            raise DeviceError(
                f"{drive.who}: answers SYNC after {1e3 * min(times):.3g} ms, the loop waits "
                f"{1e3 * self._timeout:.3g} ms; lower the rate or raise reply_timeout"
            )

    def _clear(self, talk: Talk, drive: Drive) -> None:
        why = talk.why()
        if not self.settings.clear_fault:
            raise DeviceError(
                f"{drive.who}: is in fault: {why}; see that the axis may move, then set `clear_fault: true` "
                "in the section device"
            )
        end = time.monotonic() + 1.0
        while talk.state in _FAULTS and time.monotonic() < end:
            talk.step(FAULT_RESET)
            talk.step(DISABLE_VOLTAGE)
        if talk.state in _FAULTS:
            raise DeviceError(f"{drive.who}: its fault cannot be reset: {why}; switch it off and on")
        talk.emergency = None
        self.remarks.append(f"{drive.who}: was in fault: {why}; reset")

    def _miss(self, talk: Talk) -> None:
        self.counters["missed"] += 1
        self._missed += 1
        if self._missed > self.max_missed:
            raise DeviceTimeoutError(
                f"{talk.who}: no sample in {self._missed} exchanges in a row (waited "
                f"{1e3 * self._timeout:.3g} ms in each); is it still powered and connected?"
            )
        if talk.last is not None and talk.last.status == OK:
            talk.last = talk.last._replace(status=STALE)

    def _disable(self, talk: Talk) -> bool:
        """Take the torque away; return that the drive says so, raise DeviceError where it does not."""
        for _ in range(3):
            if talk.step(DISABLE_VOLTAGE) and talk.state is not State.ENABLED:
                return True
        drive = self._drive  # PDOs do not get through; SDO may
        assert drive is not None
        drive.write(0x6040, 0, DISABLE_VOLTAGE)
        talk.state = state_of(drive.read(0x6041))
        if talk.state is State.ENABLED:
            raise DeviceError(f"{drive.who}: stays enabled")
        return True

    def _give_back(self, talk: Talk) -> None:
        """Leave the drive pre-operational, as it was before, and let go of the bus. Raises nothing."""
        from rtcomp_drivers.cia402_fit import give_back

        drive, self._drive = self._drive, None
        try:
            if self._taken and drive is not None and self._fit is not None:
                with contextlib.suppress(DeviceError):  # first: without it there are no PDOs
                    drive.command(_PRE_OPERATIONAL)
                give_back(drive, self.settings, self._fit)
        except DeviceError as error:
            self.remarks.append(f"{error}; its heartbeats and largest torque stay as they are")
        finally:
            self._taken = False
            talk.link.close()
