"""In which units a recording is: read otherwise, would the stage's mass and a loop's rate make sense?

A belief of mass and force per volt alone is enough to tell. What the motion asks for beside the mass
(friction, damping, a spring, a weight) is fitted; only the mass is compared. A position in millimetres makes
it a thousandth of what it is, a command in milliamperes a thousand times as much, a time in milliseconds a
million times, at a rate of 1 Hz.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rtcomp.diagnosis.forces.bank import units_along
from rtcomp.diagnosis.forces.noise import Noise
from rtcomp.diagnosis.numerics.spectrum import filtered
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.errors import RecordingError
from rtcomp.kernels import Floats
from rtcomp.recording.reader import Recording
from rtcomp.stage.balance import around_rows
from rtcomp.stage.stage import Stage

SLOWEST, FASTEST = 5.0, 2e5
"""Rates (Hz) between which a loop or a logger of one runs."""
BEYOND = 20.0
"""Times the stage's voltage limit, from which on a command is in another unit."""
NEAR = 3.0
"""Factor that a mass may be off beside its unit."""
MASS = "the stage's mass"
EXCERPT = 40_000
"""Rows that are looked at."""
STOPS = 6
"""Stop elements, from a ten-thousandth of the stroke to a third of it."""


@dataclass(frozen=True)
class Reading:
    """A column in another unit: what to multiply it by."""

    column: str
    factor: float
    unit: str

    def applied(self, recording: Recording) -> Recording:
        """Return the recording in SI units."""
        columns = dict(recording.columns)
        for name in (self.column, "reference") if self.column == "position" else (self.column,):
            if name in columns:
                columns[name] = self.factor * columns[name]
        rate = recording.rate_hz / (self.factor if self.column == "time" else 1.0)
        return replace(recording, columns=columns, rate_hz=rate)


def in_si_units(
    stage: Stage, recordings: Sequence[Recording], *, assume: bool
) -> tuple[list[Recording], list[str]]:
    """Return the recordings in SI units, and what was taken for granted.

    Raises RecordingError where a column is in another unit, unless it may be `assume`d; it names what the
    column is likely to be in. Raises it too where recordings are of different axes.
    """
    found: list[Recording] = []
    notes: list[str] = []
    for recording in recordings:
        for _ in ("time", "voltage", "position"):
            told = _misread(stage, recording)
            if told is None:
                break
            why, readings = told
            first = readings[0]
            if not assume:
                likely = " or ".join(
                    f"{r.column} in {r.unit} (multiply it by {r.factor:.4g})" for r in readings
                )
                raise RecordingError(
                    f"{recording.path}: {why}; likely {likely}; --assume-units takes {first.column} to be in "
                    f"{first.unit}"
                )
            recording = first.applied(recording)
            notes.append(f"{recording.path.name}: {first.column} is taken to be in {first.unit}: {why}")
        found.append(recording)
    _one_axis(stage, found)
    return found, notes


def _one_axis(stage: Stage, recordings: Sequence[Recording]) -> None:
    """Raise RecordingError where the motions ask for masses too different to be of one axis."""
    if len(recordings) < 2:
        return
    masses = [mass_asked_for(stage, r) for r in recordings]
    small = int(np.argmin([m.value + m.slack for m in masses]))
    large = int(np.argmax([m.value - m.slack for m in masses]))
    if masses[large].value - masses[large].slack > NEAR * (masses[small].value + masses[small].slack):
        one, other = recordings[small], recordings[large]
        raise RecordingError(
            f"recordings of different axes: the motion of {one.path} asks for a mass of "
            f"{masses[small].value:.3g}, that of {other.path} for {masses[large].value:.3g} "
            f"({_mass_unit(stage)}); diagnose each by itself"
        )


def _mass_unit(stage: Stage) -> str:
    return "kg m^2" if stage.axis == "rotary" else "kg"


def _misread(stage: Stage, recording: Recording) -> tuple[str, list[Reading]] | None:
    """Return why a recording is not in SI units and the likely ones, None where it may well be."""
    rate = recording.rate_hz
    if rate < SLOWEST:
        made = [Reading("time", 1e-3, "ms"), Reading("time", 1e-6, "us")]
        likely = [r for r in made if SLOWEST <= rate / r.factor <= FASTEST]
        counted = "" if rate != 1.0 else " (or counts rows: give --rate)"
        return f"rows are {1.0 / rate:.3g} s apart, a rate of {rate:.3g} Hz{counted}", likely or made
    largest = float(np.max(np.abs(recording.voltage)))
    if largest > BEYOND * stage.voltage_limit:
        why = f"voltage reaches {largest:.3g} V, the stage's voltage_limit is {stage.voltage_limit:g} V"
        names = {1e-3: "mV or mA", 1e-6: "uV or uA"}
        made = [Reading("voltage", f, unit) for f, unit in names.items()]
        likely = [r for r in made if largest * r.factor <= 2.0 * stage.voltage_limit]
        return why, likely or made
    mass = mass_asked_for(stage, recording)
    if mass.value <= 0.0 or abs(mass.value - stage.mass) <= mass.slack:
        return None
    likely = [r for r, times in _by_mass(stage) if 1.0 / NEAR < mass.value / (times * stage.mass) < NEAR]
    if not likely:
        return None
    why = (
        f"the motion asks for a mass of {mass.value:.3g} {_mass_unit(stage)}, the stage has {stage.mass:.3g}"
    )
    return why, likely


def _by_mass(stage: Stage) -> list[tuple[Reading, float]]:
    """Return readings, and times the true mass that the motion asks for as recorded."""
    lengths = {1e-3: "mrad", 1e-6: "urad"} if stage.axis == "rotary" else {1e-3: "mm", 1e-6: "um"}
    if stage.axis == "rotary":
        lengths[math.pi / 180.0] = "degrees"
    found = [(Reading("position", f, unit), f) for f, unit in lengths.items()]
    found += [(Reading(MASS, 1e-3, "g"), 1e-3), (Reading(MASS, 1e-6, "mg"), 1e-6)]
    found += [(Reading("voltage", 1e-3, "mV or mA"), 1e3), (Reading("position", 1e3, "km"), 1e3)]
    found += [(Reading("voltage", 1e-6, "uV or uA"), 1e6)]
    found += [(Reading("voltage", 1e3, "kV or kA"), 1e-3), (Reading("voltage", 1e6, "MV or MA"), 1e-6)]
    return [*found, (Reading("time", 1e-3, "ms"), 1e6)]


class Mass(NamedTuple):
    """A mass (kg or kg m^2), and by how much it would be off if what is left moved with the acceleration."""

    value: float
    slack: float


def mass_asked_for(stage: Stage, recording: Recording) -> Mass:
    """Return the mass that a motion asks for beside all other forces; any is possible where nothing moves.

    Regression of the drive's force on acceleration, damping, friction of six yield displacements, a spring
    and a constant, below the frequency where noise is as strong as the motion.
    """
    rows = slice(0, EXCERPT)
    short = replace(recording, columns={name: c[rows] for name, c in recording.columns.items()})
    data = load_data([short])
    bare = stage.with_changes(sensor={"noise": 0.0, "resolution": 0.0})
    noise = Noise.of(bare, data)
    low, high = data.stroke
    reaches = np.geomspace(1e-4, 0.3, STOPS) * (high - low)
    columns, given = [], []
    for s in data.segments:
        x = filtered(s.position, data.rate, noise.wiener)
        v = np.gradient(x, data.period)
        a = np.gradient(v, data.period)
        held = np.append(s.voltage[:1], s.voltage[:-1])
        motion = np.ascontiguousarray(np.column_stack([s.time, x, v, a, held]))
        units = units_along(stage, [], [], reaches, np.zeros(STOPS), motion, 0.0)
        mean = 0.5 * (held + np.append(held[1:], held[-1:])) * stage.force_constant
        table = np.column_stack([a, around_rows(v), units, around_rows(x), np.ones(x.size), mean])
        low_passed = filtered(np.ascontiguousarray(table.T), data.rate, noise.wiener, noisy=True)
        edge = min(100, x.size // 10)
        columns.append(low_passed[:-1, edge:-edge])
        given.append(low_passed[-1, edge:-edge])
    a, rest, y = np.hstack(columns)[0], np.hstack(columns)[1:], np.concatenate(given)
    basis = rest / np.maximum(np.linalg.norm(rest, axis=1), 1e-300)[:, None]
    a_left, y_left = _without(basis, a), _without(basis, y)
    power = float(a_left @ a_left)
    if not power > 0.0:
        return Mass(stage.mass, math.inf)
    mass = float(a_left @ y_left) / power
    return Mass(mass, float(np.linalg.norm(y_left - mass * a_left)) / math.sqrt(power))


def _without(basis: Floats, column: Floats) -> Floats:
    """Return what the rows of a basis (p, n) leave of a column (n,)."""
    return np.asarray(column - np.linalg.lstsq(basis.T, column, rcond=1e-10)[0] @ basis)
