"""Does a CiA 402 drive fit the run? Units, limits, mode and watchdog, read and set by SDO before arming."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rtcomp.errors import ConfigError, DeviceError, ProtocolError
from rtcomp_drivers.cia402_states import CYCLIC_TORQUE, MODES, PROFILE_TORQUE, si_unit, supports

if TYPE_CHECKING:
    from rtcomp_drivers.cia402_settings import Cia402Settings
    from rtcomp_drivers.cia402_setup import Drive
    from rtcomp_drivers.driver import Bench

_MOST = 32_767
"""Thousandths of rated torque, largest that 6071h takes."""
_SHOWN_S = 0.5
"""s that a drive may take to show the mode that was set."""
_FAULT_SIGNAL = 1


@dataclass
class Fit:
    """What was found out and set."""

    per_mille: float = 1.0
    """Thousandths of rated torque, 6071h, per V of command."""
    limit: int = 1000
    """Thousandths of rated torque, at most."""
    count_size: float = 1.0
    """m (rad) per count of 6064h."""
    mode: int = CYCLIC_TORQUE
    before: dict[int, int] = field(default_factory=dict)
    """Objects that are changed for the run, with what was in them."""
    remarks: list[str] = field(default_factory=list)


def check_profile(drive: Drive, device_type: int) -> None:
    """Raise ProtocolError for a device type, 1000h, that is not a CiA 402 drive's."""
    if device_type & 0xFFFF != 402:
        raise ProtocolError(
            f"{drive.who}: its device type is {device_type:08X}h, of profile {device_type & 0xFFFF}; a drive "
            "of CiA 402 is wanted: is this its node number?"
        )


def fit(drive: Drive, settings: Cia402Settings, bench: Bench) -> Fit:
    """Read what the drive is and compare; raise ConfigError, DeviceError, ProtocolError where it is unfit."""
    found = Fit(mode=_mode(drive, settings), count_size=_count_size(drive, settings, bench))
    rated = settings.rated_torque
    if drive.has(0x6076):
        told = 1e-3 * drive.read(0x6076)
        if rated is not None and abs(told - rated) > 0.01 * rated + 1e-3:
            raise ConfigError(
                f"device: rated_torque is {rated:g} N m; {drive.who} says {told:g} (6076h, in mN m): "
                "leave it out, or correct one of them",
                key=("rated_torque",),
            )
        rated = told if rated is None else rated
    if rated is None or rated <= 0.0:
        raise ConfigError(
            f"device: {drive.who} says no rated torque (6076h); set rated_torque", key=("rated_torque",)
        )
    stage = bench.stage
    constant = settings.torque_per_volt
    if constant is None:
        constant = 1.0 if stage is None else stage.mechanics.force_constant
    found.per_mille = 1000.0 * constant / rated
    volts = settings.voltage_limit
    if volts is None and stage is not None:
        volts = stage.voltage_limit
    found.limit = _MOST if volts is None else min(_MOST, max(1, math.ceil(volts * found.per_mille - 1e-6)))
    if drive.has(0x6072):
        its_own = found.before[0x6072] = drive.read(0x6072)
        if its_own == 0:
            raise DeviceError(
                f"{drive.who}: its largest torque (6072h) is 0; set it, or switch the drive off and on"
            )
        if its_own < found.limit and volts is not None:
            found.remarks.append(
                f"{drive.who}: its largest torque (6072h) is {its_own / found.per_mille:.3g} V; the run's "
                f"voltage limit of {volts:g} V is not reached"
            )
        found.limit = min(found.limit, its_own)
    if found.limit < 100:
        found.remarks.append(
            f"{drive.who}: one step of 6071h is {1.0 / found.per_mille:.3g} V, the limit {found.limit} of "
            "them; a motor of lower rated torque would be finer"
        )
    return found


def configure(drive: Drive, settings: Cia402Settings, bench: Bench, found: Fit) -> None:
    """Set limits, mode, watchdog and PDOs; raise where the drive does not take what safety needs."""
    found.before[0x1017] = drive.read(0x1017)
    drive.write(0x1017, 0, settings.heartbeat_ms)
    if settings.drive_watchdog:
        value = settings.host_node << 16 | round(1e3 * settings.watchdog)
        drive.write(0x1016, 1, value)
        if drive.read(0x1016, 1) != value:
            raise DeviceError(
                f"{drive.who}: did not keep the watchdog (1016h:1, {round(1e3 * settings.watchdog)} ms); it "
                "may need longer, or its own software to set it"
            )
        if drive.has(0x6007):
            drive.write(0x6007, 0, _FAULT_SIGNAL)
        else:
            found.remarks.append(
                f"{drive.who}: has no 6007h; its manual says what it does when the heartbeat is lost"
            )
    else:
        found.remarks.append(
            f"{drive.who}: runs without watchdog (drive_watchdog: false); if this program dies, torque stays"
        )
    drive.write(0x6071, 0, 0)
    if drive.has(0x6072):
        drive.write(0x6072, 0, found.limit)
    _optional(drive, found, 0x6087, 0, 0x7FFFFFFF if found.mode == PROFILE_TORQUE else None)
    value, exponent = _cycle_time(bench.period)
    _optional(drive, found, 0x60C2, 1, value)
    _optional(drive, found, 0x60C2, 2, exponent)
    _set_mode(drive, found.mode)
    turned_off = drive.map_pdos([0x6041, 0x6064], [0x6040, 0x6071])
    if turned_off:
        found.remarks.append(f"{drive.who}: {turned_off} other PDOs were turned off until it is reset")


def give_back(drive: Drive, settings: Cia402Settings, found: Fit) -> None:
    """Undo what would outlive the run; raises as `Drive.write` does."""
    if settings.drive_watchdog:
        drive.write(0x1016, 1, 0)  # else it would find our heartbeat lost, and be in fault
    for index, value in found.before.items():
        drive.write(index, 0, value)


def _mode(drive: Drive, settings: Cia402Settings) -> int:
    wanted = {"cyclic": CYCLIC_TORQUE, "profile": PROFILE_TORQUE}
    if not drive.has(0x6502):
        return wanted.get(settings.mode or "cyclic", CYCLIC_TORQUE)
    modes = drive.read(0x6502)
    asked = [CYCLIC_TORQUE, PROFILE_TORQUE] if settings.mode is None else [wanted[settings.mode]]
    for mode in asked:
        if supports(modes, mode):
            return mode
    raise DeviceError(
        f"{drive.who}: its modes (6502h, {modes:X}h) have no {' or '.join(MODES[m] for m in asked)} mode"
    )


def _count_size(drive: Drive, settings: Cia402Settings, bench: Bench) -> float:
    unit = si_unit(drive.read(0x60A8)) if drive.has(0x60A8) else None
    axis = None if bench.stage is None else bench.stage.axis
    said = None
    if unit is not None and unit.unit != "counts":
        its_axis = "linear" if unit.unit == "m" else "rotary"
        if axis is not None and its_axis != axis:
            raise DeviceError(
                f"{drive.who}: its positions are in {unit.unit}, {its_axis}; the stage is {axis}: is this it?"
            )
        to_si = {"m": 1.0, "rad": 1.0, "deg": math.pi / 180.0, "rev": 2.0 * math.pi}
        said = to_si[unit.unit] * unit.factor
    size = settings.count_size
    if size is None and settings.counts_per_turn is not None:
        if axis == "linear":
            raise ConfigError(
                "device: counts_per_turn is for rotary axes; this stage is linear: set count_size (m)",
                key=("counts_per_turn",),
            )
        size = 2.0 * math.pi / settings.counts_per_turn
    if size is None:
        if said is None:
            raise ConfigError(
                f"device: {drive.who} does not say what a count of 6064h is; set count_size (m or rad) or "
                "counts_per_turn"
            )
        return said
    if said is not None and abs(said - size) > 1e-6 * size:
        raise ConfigError(
            f"device: a count is {size:g} here, {said:g} as {drive.who} has it (60A8h); leave count_size "
            "out, or correct one of them",
            key=("count_size",),
        )
    return size


def _cycle_time(period: float) -> tuple[int, int]:
    """Return the period as 60C2h has it: a number up to 255 and a power of ten of a second."""
    for exponent in range(0, -7, -1):
        value = period / 10.0**exponent
        if value >= 1.0 and (abs(value - round(value)) < 1e-6 * value or value > 25.5):
            return min(255, round(value)), exponent
    return 1, -6


def _optional(drive: Drive, found: Fit, index: int, sub: int, value: int | None) -> None:
    """Set what the drive may have; where it refuses, say so."""
    if value is None or not drive.has(index, sub):
        return
    try:
        drive.write(index, sub, value)
    except ProtocolError as error:
        found.remarks.append(f"{error}; left as it is")


def _set_mode(drive: Drive, mode: int) -> None:
    drive.write(0x6060, 0, mode)
    end = time.monotonic() + _SHOWN_S
    while (shown := drive.read(0x6061)) != mode:
        if time.monotonic() > end:
            raise DeviceError(
                f"{drive.who}: was set to {MODES[mode]} mode ({mode}), but shows mode {shown} (6061h)"
            )
        drive.listen(0.005)
