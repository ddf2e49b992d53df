"""In which units a recording is, told from a belief of mass and force per volt alone."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import RATE, changed, run, stage, there_and_back

from rtcomp.diagnosis.forces.readings import in_si_units, mass_asked_for
from rtcomp.diagnosis.recordings.admit import admit
from rtcomp.errors import ConfigError, RecordingError
from rtcomp.recording.reader import Recording
from rtcomp.stage.stage import Stage

SEVERAL = 0.5 * there_and_back() + 2e-5 * np.sin(2 * np.pi * 23.0 * np.arange(6 * int(RATE)) / RATE)
"""Motion in which inertia shows: without it no recording tells a mass, or a unit by it."""


def thin(axis: str = "linear", **changes: float) -> Stage:
    """A belief that has nothing but mass, force per volt and the limit."""
    numbers = {"mass": 2.0, "force_constant": 4.0, "voltage_limit": 10.0, **changes}
    return Stage.from_dict({"stage": {"axis": axis, **numbers}})


@pytest.fixture(scope="module")
def good() -> Recording:
    return run(stage(), SEVERAL)


def read_as(recording: Recording, column: str, times: float) -> Recording:
    """The recording as a file in another unit gives it."""
    if column == "time":
        recording = replace(recording, rate_hz=recording.rate_hz / times)
    columns = {column: times * recording.columns[column]}
    if column == "position":
        columns["reference"] = times * recording.columns["reference"]
    return changed(recording, **columns)


UNITS = [
    ("linear", "position", 1e3, "position in mm"), ("linear", "position", 1e6, "position in um"),
    ("rotary", "position", 180.0 / math.pi, "position in degrees"),
    ("linear", "voltage", 1e3, "voltage in mV or mA"), ("linear", "time", 1e3, "time in ms"),
    ("linear", "time", 1e6, "time in us"),
]  # fmt: skip


@pytest.mark.parametrize(("axis", "column", "times", "says"), UNITS)
def test_another_unit_is_refused_by_name_or_taken_and_said(
    good: Recording, axis: str, column: str, times: float, says: str
) -> None:
    wrong = read_as(good, column, times)
    with pytest.raises(RecordingError, match=r"--assume-units") as refused:
        in_si_units(thin(axis), [wrong], assume=False)
    assert says in str(refused.value) and "\n" not in str(refused.value)
    (taken,), notes = in_si_units(thin(axis), [wrong], assume=True)
    assert any(says.replace(" in ", " is taken to be in ") in note for note in notes)
    assert taken.rate_hz == pytest.approx(good.rate_hz)
    for name in ("time", "position", "reference", "voltage"):
        assert taken.columns[name] == pytest.approx(good.columns[name])


@settings(max_examples=15, deadline=None)
@given(st.floats(0.6, 1.6), st.floats(0.6, 1.6))
def test_a_belief_that_is_off_is_no_other_unit(good: Recording, mass: float, constant: float) -> None:
    belief = thin(mass=2.0 * mass, force_constant=4.0 * constant)
    assert in_si_units(belief, [good], assume=False) == ([good], [])


def test_a_row_counter_in_place_of_time_is_told(good: Recording) -> None:
    with pytest.raises(RecordingError, match="counts rows: give --rate"):
        in_si_units(thin(), [read_as(good, "time", RATE)], assume=False)


def test_recordings_of_different_axes_are_refused(good: Recording) -> None:
    heavy = replace(run(stage(mass=20.0), SEVERAL), path=Path("heavy.csv"))
    with pytest.raises(RecordingError, match=r"different axes.*run\.csv.*heavy\.csv"):
        in_si_units(thin(), [good, heavy], assume=False)
    again = replace(run(stage(mass=2.5), SEVERAL, seed=2), path=Path("again.csv"))
    assert in_si_units(thin(), [good, again], assume=False)[1] == []


def test_a_mass_that_a_motion_hardly_tells_is_of_any_axis(good: Recording) -> None:
    """A slow motion with a force that nobody believes: what it asks for is far off, and not sure."""
    slow = run(stage(), there_and_back())
    force = 0.5 * np.sin(slow.position / 2e-5) + 0.3 * np.sin(2 * np.pi * 0.7 * slow.time) ** 3
    pushed = changed(slow, voltage=slow.voltage + force)
    mass = mass_asked_for(thin(), pushed)
    assert abs(mass.value - 2.0) < mass.slack
    assert in_si_units(thin(), [good, replace(pushed, path=Path("slow.csv"))], assume=False)[1] == []


def test_an_effect_that_no_axis_has_is_refused(good: Recording) -> None:
    belief = Stage.from_dict(
        {"stage": {**thin().to_dict()["stage"], "effects": [{"name": "quadratic-drag", "coefficient": -3.0}]}}
    )
    with pytest.raises(ConfigError, match=r"quadratic-drag has coefficient -3 .*\[0, "):
        admit(belief, [good])
