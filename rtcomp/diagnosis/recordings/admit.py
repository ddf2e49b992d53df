"""What a diagnosis can be made of: checks on the stage and the recordings before anything is fitted.

`admit` refuses, in one line, what no diagnosis could be made of; what it can be made of with less to see,
it says in notes. Mistaken units, swapped columns and signs are told from the stage's own force balance: as
recorded it leaves everything unexplained, read the other way it closes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from rtcomp.diagnosis.recordings import excitation
from rtcomp.diagnosis.recordings.stretches import LEAST_ROWS, stretches
from rtcomp.errors import ConfigError, RecordingError
from rtcomp.kernels import Floats
from rtcomp.physics import catalogue
from rtcomp.recording.reader import Recording
from rtcomp.stage.balance import force_balance
from rtcomp.stage.simulate import Simulator, largest_step
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis

MIN_ROWS, MIN_SECONDS = 1000, 2.0
"""All recordings together; below, no part can be left out of the fit."""
GOOD_SECONDS = 20.0
MIN_PIECE = 64
"""Rows of one recording: what the force balance needs."""
MOST_STEPS = 10_000
"""Integration steps a row, above which a simulation of minutes takes hours."""
_EXCERPT = 60_000
"""Rows that mistaken units are looked for in."""
_RUNAWAY = 1e6
"""Times the travel of the free mass, above which a simulated position is not the axis's."""
_HARDLY = 0.8
_POOR, _CLOSED = 0.6, 0.45
"""Mismatch of the balance above which another reading is tried, and below which it is believed."""


def admit(stage: Stage, recordings: Sequence[Recording]) -> list[str]:
    """Check that `recordings` can be diagnosed against `stage`; return what limits it, one line each.

    Raises RecordingError for recordings of different rates, of another kind of axis, given twice, too short,
    without motion or command, clipped throughout, mostly bridged, without a reversal, and where the force
    balance shows that columns are swapped, scaled or of the wrong sign; ConfigError for a stage that cannot
    be simulated, or has an effect beyond its physical bounds.
    """
    if not recordings:
        raise RecordingError("no recording is given; a diagnosis needs at least one")
    _alike(recordings)
    _long_enough(recordings)
    for recording in recordings:
        _same_axis(stage, recording)
    _physical(stage)
    _can_be_simulated(stage, recordings[0].rate_hz)
    _whole_enough(recordings)
    notes = [_named(note, r, recordings) for r in recordings for note in _fits(stage, r)]
    unit = for_axis("m", stage.axis)
    notes += excitation.check(recordings, unit)
    for r in recordings:
        notes += [_named(note, r, recordings) for note in excitation.clipping(r, stage.voltage_limit, unit)]
    return notes + _rates(stage, recordings)


def _named(note: str, recording: Recording, recordings: Sequence[Recording]) -> str:
    return note if len(recordings) == 1 else f"in {recording.path.name}: {note}"


def _alike(recordings: Sequence[Recording]) -> None:
    first = recordings[0]
    for i, recording in enumerate(recordings):
        if abs(recording.rate_hz / first.rate_hz - 1.0) > 1e-3:
            raise RecordingError(
                f"recordings of different rates: {first.path} has {first.rate_hz:g} Hz, {recording.path} "
                f"{recording.rate_hz:g} Hz; give --rate to bring them to one"
            )
        for other in recordings[:i]:
            if np.array_equal(other.position, recording.position) and np.array_equal(
                other.voltage, recording.voltage
            ):
                raise RecordingError(
                    f"{recording.path} holds the same rows as {other.path}; give each recording once, or "
                    "what was fitted would be judged on itself"
                )


def _long_enough(recordings: Sequence[Recording]) -> None:
    for recording in recordings:
        if len(recording) < MIN_PIECE:
            raise RecordingError(
                f"{recording.path}: {len(recording)} rows; a force balance needs at least {MIN_PIECE}"
            )
    rows = sum(len(r) for r in recordings)
    seconds = sum(len(r) / r.rate_hz for r in recordings)
    if rows < MIN_ROWS or seconds < MIN_SECONDS:
        needed = max(MIN_SECONDS, MIN_ROWS / recordings[0].rate_hz)
        what = f"{recordings[0].path}: is" if len(recordings) == 1 else "the recordings are together"
        raise RecordingError(
            f"{what} too short for a diagnosis: {rows} rows, {seconds:.3g} s; at least {needed:.3g} s at "
            f"{recordings[0].rate_hz:g} Hz are needed, {GOOD_SECONDS:g} s with ten reversals are good"
        )


def _whole_enough(recordings: Sequence[Recording]) -> None:
    """Raise RecordingError where gaps leave stretches that are too short, or too little of them."""
    first = recordings[0]
    least = max(MIN_ROWS, int(MIN_SECONDS * first.rate_hz))
    left = sum(rows.stop - rows.start for r in recordings for rows in stretches(r.trusted))
    if left < least and not all(r.trusted.all() for r in recordings):
        holes = sum(int(np.count_nonzero(np.diff(r.trusted.astype(np.int8)) < 0)) for r in recordings)
        what = f"{first.path}: gaps cut it" if len(recordings) == 1 else "gaps cut the recordings"
        raise RecordingError(
            f"{what} into stretches too short for a diagnosis: {holes} gaps or outliers leave "
            f"{left / first.rate_hz:.3g} s in stretches of {LEAST_ROWS / first.rate_hz:.3g} s or more, "
            f"{least / first.rate_hz:.3g} s are needed; record it again"
        )


def _same_axis(stage: Stage, recording: Recording) -> None:
    recorded = _axis_of(recording.metadata.get("stage"))
    if recorded is not None and recorded != stage.axis:
        raise RecordingError(
            f"{recording.path}: was recorded on a {recorded} axis, the stage is {stage.axis}; give the stage "
            "that it was recorded on"
        )


def _axis_of(stage: Any) -> str | None:
    """Return the axis that a recording's own metadata name, if they do."""
    if isinstance(stage, str):
        try:
            stage = json.loads(stage)
        except json.JSONDecodeError:  # another program's attribute of that name
            return None
    section = stage.get("stage") if isinstance(stage, dict) else None
    if not isinstance(section, dict):
        return None
    axis = section.get("axis", "linear")
    return axis if axis in ("linear", "rotary") else None


def _physical(stage: Stage) -> None:
    """Raise ConfigError where a believed effect has a number that no axis has."""
    for entry in stage.mechanics.effects:
        kind = catalogue.entry(str(entry["name"]))
        for p in kind.parameters:
            value = entry.get(p.name)
            if isinstance(value, int | float) and value < p.lowest:
                raise ConfigError(
                    f"the stage's {kind.name} has {p.name} {value:g} {p.unit}; physical is "
                    f"[{p.lowest:g}, {p.high:g}]; correct it or leave the effect out"
                )


def _can_be_simulated(stage: Stage, rate_hz: float) -> None:
    step = largest_step(stage)
    steps = 1.0 / (rate_hz * step)
    if steps > MOST_STEPS:
        stiffness = sum(e.stiffness() for e in stage.chain)
        raise ConfigError(
            f"the stage cannot be simulated in reasonable time: stiffness {stiffness:.3g} N/m on mass "
            f"{stage.mass:.3g} kg needs {steps:.3g} steps a row at {rate_hz:g} Hz, at most {MOST_STEPS} are "
            "done; check mass, friction and damping"
        )
    simulator = Simulator(stage)
    free = 0.5 * stage.voltage_limit * stage.force_constant / stage.mass  # m, in one second
    ticks = max(8, min(200, int(100_000 / max(steps, 1.0))))
    for k in range(ticks):
        simulator.advance(0.5 * stage.voltage_limit * np.sin(2 * np.pi * k / ticks), 1.0 / rate_hz)
        if not abs(simulator.position) < _RUNAWAY * free:
            raise ConfigError(
                f"the stage cannot be simulated: its position is {simulator.position:.3g} m "
                f"{(k + 1) / rate_hz:.3g} s after the start, under half of its voltage limit; check mass, "
                "stiffness and damping"
            )


def _fits(stage: Stage, recording: Recording) -> list[str]:
    """Check that the recording moves, and in the stage's units; return notes."""
    # Units between the two: a position in km looks like no motion to a sensor that counts nanometres.
    unit = for_axis("m", stage.axis)
    excitation.moved(recording, 0.0, unit)
    notes = _units(stage, recording)
    excitation.moved(recording, _noise(stage), unit)
    return notes


def _noise(stage: Stage) -> float:
    """Return the rms (m) of what the stage's sensor reads where nothing moves."""
    return float(np.hypot(stage.sensor.noise, stage.sensor.resolution / np.sqrt(12.0)))


def _rates(stage: Stage, recordings: Sequence[Recording]) -> list[str]:
    rate = recordings[0].rate_hz
    if abs(rate / stage.rate - 1.0) > 0.05:
        return [f"recorded at {rate:g} Hz, the stage's controller runs at {stage.rate:g} Hz"]
    return []


class _Reading(NamedTuple):
    """The recording read another way: what to do to position and voltage, and what that would mean."""

    position: Callable[[Floats, Floats], Floats]
    voltage: Callable[[Floats, Floats], Floats]
    looks: str
    do: str


def _readings(recording: Recording) -> Iterable[_Reading]:
    yield _Reading(
        lambda x, u: u, lambda x, u: x, "position and voltage are swapped",
        "swap them: --map position=voltage --map voltage=position, or as the file calls them",
    )  # fmt: skip
    for exponent in (-3, 3, -6, 6):
        factor = 10.0**exponent
        size = f"1e{abs(exponent)} times too {'large' if exponent < 0 else 'small'}"
        prefix = {-3: "m", -6: "u"}.get(exponent, "")
        unit = {name: f" (in {prefix}{name} rather than {name}?)" if prefix else "" for name in "mV"}
        yield _Reading(
            lambda x, u, f=factor: f * x, lambda x, u: u,  # type: ignore[misc]
            f"position is {size}{unit['m']}", f"multiply it by {factor:g}",
        )  # fmt: skip
        yield _Reading(
            lambda x, u: x, lambda x, u, f=factor: f * u,  # type: ignore[misc]
            f"voltage is {size}{unit['V']}", f"multiply it by {factor:g}",
        )  # fmt: skip
        yield _Reading(
            lambda x, u, f=factor: f * x, lambda x, u, f=factor: f * u,  # type: ignore[misc]
            f"position and voltage are both {size}", f"multiply both by {factor:g}",
        )  # fmt: skip


def _units(stage: Stage, recording: Recording) -> list[str]:
    """Raise RecordingError where the force balance closes only if the recording is read another way."""
    position, voltage = _bridged(recording)
    time = np.arange(position.size) / recording.rate_hz

    def mismatch(x: Floats, u: Floats) -> float:
        balance = force_balance(stage, time, x, u)
        # A weight or an offset that the stage does not know says nothing of units and signs.
        drive, motion = float(np.std(balance.force_drive)), float(np.std(balance.force_motion))
        difference = float(np.std(balance.force_drive - balance.force_motion))
        return difference / max(drive, motion, 1e-300) if np.isfinite(difference) else np.inf

    as_recorded = mismatch(position, voltage)
    if as_recorded <= _POOR:
        return []
    flipped = mismatch(position, -voltage)
    if flipped < min(_CLOSED, 0.3 * as_recorded):
        which = _which_sign(recording)
        raise RecordingError(
            f"{recording.path}: {which} has the wrong sign: as recorded the stage's force balance is off by "
            f"{_percent(as_recorded)}, with the sign of {which} turned by {_percent(flipped)}; turn it, or "
            "the wiring"
        )
    found = [
        (mismatch(reading.position(position, voltage), reading.voltage(position, voltage)), reading)
        for reading in _readings(recording)
    ]
    best, reading = min(found, key=lambda pair: pair[0])
    if best < min(_CLOSED, 0.7 * as_recorded):
        raise RecordingError(
            f"{recording.path}: it looks as if {reading.looks}: as recorded the stage's force balance is off "
            f"by {_percent(as_recorded)}, read so by {_percent(best)}; {reading.do}, or correct the stage"
        )
    if as_recorded < _HARDLY:
        return []
    return [
        f"the stage hardly describes this recording: its force balance is off by {_percent(as_recorded)} of "
        "the force"
    ]


def _which_sign(recording: Recording) -> str:
    """Return the column whose sign is wrong: position where it goes against its own reference."""
    reference = recording.reference
    if reference is None or not np.ptp(reference):
        return "voltage (or position)"
    against = float(np.corrcoef(reference, recording.position)[0, 1]) < -0.5
    return "position" if against else "voltage"


def _bridged(recording: Recording) -> tuple[Floats, Floats]:
    """Return position and voltage of the excerpt that is looked at, doubtful rows interpolated."""
    middle = slice(None)
    if len(recording) > _EXCERPT:
        begin = (len(recording) - _EXCERPT) // 2
        middle = slice(begin, begin + _EXCERPT)
    good = recording.trusted[middle]
    rows = np.arange(good.size)
    position, voltage = recording.position[middle], recording.voltage[middle]
    if good.all() or not good.any():
        return np.ascontiguousarray(position), np.ascontiguousarray(voltage)
    return np.interp(rows, rows[good], position[good]), np.interp(rows, rows[good], voltage[good])


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"
