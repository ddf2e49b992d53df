"""What a diagnosis can be made of, and what each thing it cannot be made of looks like."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import at_hand, changed, cut, of_axis, run, stage, there_and_back

from rtcomp.diagnosis.recordings.admit import admit
from rtcomp.diagnosis.recordings.excitation import reversals
from rtcomp.errors import ConfigError, RecordingError
from rtcomp.recording.reader import Recording, read
from rtcomp.stage.stage import Stage

Change = Callable[[Recording], Recording]


@pytest.fixture(scope="module")
def good() -> Recording:
    return run(stage(), there_and_back())


def test_a_good_recording_passes_without_a_word(good: Recording) -> None:
    assert admit(stage(), [good]) == []
    assert admit(stage(), [of_axis(good, "linear")]) == []


@settings(max_examples=20, deadline=None)
@given(st.floats(0.8, 1.25), st.floats(0.8, 1.25), st.floats(0.8, 1.25), st.floats(-0.3, 0.3))
def test_a_mistuned_belief_or_an_offset_is_no_bad_input(
    good: Recording, mass: float, friction: float, force_constant: float, offset: float
) -> None:
    elements = [{"stiffness": k * friction, "reach": x} for k, x in ((2e5, 4e-6), (6e4, 1.2e-5))]
    belief = stage(mass=2.0 * mass, friction=elements, force_constant=4.0 * force_constant)
    assert admit(belief, [changed(good, voltage=good.voltage + offset)]) == []


def scaled(position: float = 1.0, voltage: float = 1.0) -> Change:
    return lambda r: changed(r, position=position * r.position, voltage=voltage * r.voltage)


def swapped(r: Recording) -> Recording:
    return changed(r, position=r.voltage, voltage=r.position)


def one_way(r: Recording) -> Recording:
    return run(stage(), np.linspace(0.0, 2e-3, len(r)))


def at_rest(r: Recording) -> Recording:
    chance = np.random.default_rng(1)
    reading = np.round(1.5e-8 * chance.standard_normal(len(r)), 8)
    return changed(r, position=reading, voltage=1e-3 * np.sin(0.01 * np.arange(len(r))))


def bridged(r: Recording) -> Recording:
    return changed(r, gap=(np.arange(len(r)) % 10 < 6).astype(float))


MISTAKEN: list[tuple[str, Change, str]] = [
    *((f"position x {f:g}", scaled(position=f), rf"position is 1e{abs(e)} times too {w}.*multiply it by")
      for e, f, w in ((-6, 1e-6, "small"), (-3, 1e-3, "small"), (3, 1e3, "large"), (6, 1e6, "large"))),
    *((f"voltage x {f:g}", scaled(voltage=f), rf"voltage is 1e{abs(e)} times too {w}.*multiply it by")
      for e, f, w in ((-6, 1e-6, "small"), (-3, 1e-3, "small"), (3, 1e3, "large"), (6, 1e6, "large"))),
    ("all in milli", scaled(1e3, 1e3), "position and voltage are both 1e3 times too large"),
    ("swapped", swapped, "position and voltage are swapped.*--map position=voltage"),
    ("sign of position", scaled(position=-1.0), "position has the wrong sign"),
    ("sign of voltage", scaled(voltage=-1.0), "voltage has the wrong sign"),
    ("at rest", at_rest, "nothing moved"),
    ("no command", lambda r: changed(r, voltage=0.0 * r.voltage), "voltage is -?0 V in every row"),
    ("one way", one_way, r"moves in one direction only \(up"),
    ("voltage clipped", lambda r: changed(r, voltage=np.clip(r.voltage, -0.1, 0.1)), "voltage is saturated"),
    ("position clipped", lambda r: changed(r, position=np.clip(r.position, -3e-5, 3e-5)), "is clipped"),
    ("rotary", lambda r: of_axis(r, "rotary"), "recorded on a rotary axis, the stage is linear"),
    ("mostly gaps", bridged, "60 % of its rows are outliers or bridged gaps"),
    ("a second", lambda r: cut(r, 0, 900), r"too short.*900 rows, 0.9 s; at least 2 s"),
    ("few rows", lambda r: replace(cut(r, 0, 600), rate_hz=100.0), "at least 10 s at 100 Hz"),
    ("fifty rows", lambda r: cut(r, 0, 50), "needs at least 64"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "says"), [m[1:] for m in MISTAKEN], ids=[m[0] for m in MISTAKEN])
def test_what_cannot_be_diagnosed_is_refused_in_one_line(good: Recording, change: Change, says: str) -> None:
    with pytest.raises(RecordingError) as caught:
        admit(stage(), [change(good)])
    assert re.search(says, str(caught.value)), str(caught.value)
    assert str(caught.value).startswith("run.csv: ") and "\n" not in str(caught.value)


def test_without_a_reference_the_sign_may_be_either_columns(good: Recording) -> None:
    columns = {k: v for k, v in good.columns.items() if k != "reference"}
    with pytest.raises(RecordingError, match=r"voltage \(or position\) has the wrong sign"):
        admit(stage(), [scaled(voltage=-1.0)(replace(good, columns=columns))])


def test_recordings_of_different_rates_and_the_same_one_twice(good: Recording) -> None:
    other = replace(cut(good, 0, 3000), rate_hz=500.0, path=Path("other.csv"))
    with pytest.raises(RecordingError, match=r"run.csv has 1000 Hz, other.csv 500 Hz; give --rate"):
        admit(stage(), [good, other])
    with pytest.raises(RecordingError, match=r"holds the same rows as run\.csv"):
        admit(stage(), [good, replace(good, path=Path("copy.csv"))])
    with pytest.raises(RecordingError, match="at least one"):
        admit(stage(), [])


def test_one_way_is_well_beside_a_recording_with_reversals(good: Recording) -> None:
    forth = one_way(good)
    assert admit(stage(), [good, forth]) == []
    back = replace(run(stage(), np.linspace(0.0, -2e-3, len(good))), path=Path("back.csv"))
    assert "no recording has a reversal" in admit(stage(), [forth, back])[0]


@pytest.mark.parametrize("changes", [
    {"mass": 1e-6},
    {"friction": [{"stiffness": 1e12, "reach": 1e-9}]},
])  # fmt: skip
def test_a_stage_that_takes_hours_to_simulate_is_refused(good: Recording, changes: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=r"cannot be simulated in reasonable time: .* steps a row"):
        admit(stage(**changes), [good])


@pytest.mark.parametrize("name", ["quadratic-drag", "viscous-friction"])
def test_a_believed_effect_beyond_its_physical_bounds_is_refused(good: Recording, name: str) -> None:
    """A file may hold it, for a simulation; no axis has it."""
    drives = [{"name": name, "coefficient": -3.0}]
    with pytest.raises(
        ConfigError, match=rf"{name} has coefficient -3 .*; physical is \[0, 1e\+0\d\]; correct it"
    ):
        admit(stage(effects=drives), [good])


def test_a_stage_that_runs_away_is_refused(good: Recording) -> None:
    spring = [{"name": "parallel-spring", "stiffness": -1e5}]
    with pytest.raises(ConfigError, match=r"its position is \S+ m 0\.\d+ s after the start"):
        admit(stage(effects=spring), [good])


def test_what_limits_a_diagnosis_without_forbidding_it_is_a_note(good: Recording) -> None:
    held = np.repeat(np.arange(0, len(good), 2), 2)
    twice = changed(good, position=good.position[held], voltage=good.voltage[held])
    assert any("repeat the one before" in note for note in admit(stage(), [twice]))
    gaps = changed(good, gap=(np.arange(len(good)) % 10 < 1).astype(float))
    assert any("10 % of the rows are outliers" in note for note in admit(stage(), [gaps]))
    limit = changed(good, voltage=np.clip(good.voltage, -0.9 * abs(good.voltage).max(), 1e3))
    limited = stage(voltage_limit=0.5 * abs(good.voltage).max())
    assert any("the stage's voltage_limit is" in note for note in admit(limited, [limit]))
    assert "the stage's controller runs at 1000 Hz" in admit(stage(), [replace(good, rate_hz=900.0)])[-1]
    once = run(stage(), np.interp(np.arange(6000), [0, 3000, 6000], [0.0, 2e-3, 0.0]))
    assert "only one reversal" in admit(stage(), [once])[0]
    stranger = stage(friction=[{"stiffness": 1e9, "reach": 1e-3}])
    assert "hardly describes this recording" in admit(stranger, [good])[0]
    notes = admit(stage(), [gaps, replace(run(stage(), there_and_back(5.0)), path=Path("b.csv"))])
    assert notes[0].startswith("in run.csv: ")


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 12), st.floats(1e-9, 1e3), st.floats(-1e3, 1e3), st.sampled_from([-1.0, 1.0]),
    st.integers(50, 3000),
)  # fmt: skip
def test_reversals_are_counted_whatever_the_scale_and_the_direction(
    turns: int, size: float, centre: float, way: float, rows: int
) -> None:
    corners = np.concatenate([[0.0], np.cumsum((-1.0) ** np.arange(turns + 1))])
    path = np.interp(np.linspace(0, turns + 1, rows), np.arange(turns + 2), corners)
    noise = 1e-3 * np.random.default_rng(rows).standard_normal(rows)
    assert reversals(size * (way * path + noise + centre)) == turns


@pytest.mark.parametrize("case", range(16))
def test_concealed_effects_are_no_bad_input(case: int) -> None:
    folder = at_hand(f"sealed-dev/dev{case:02d}")
    assert admit(Stage.load(folder / "stage.yaml"), [read(folder / "train.csv.gz")]) == []


def test_measured_recordings_pass_and_their_mistakes_are_told() -> None:
    names = {"time": "t", "position": "qm", "voltage": "vir", "reference": "qg"}
    emps = read(at_hand("real/emps") / "DATA_EMPS.mat", names)
    belief = stage(
        mass=95.11, force_constant=35.15, viscous=203.5, micro_damping=0.0,
        friction=[{"stiffness": 2e7, "reach": 1e-6}],
    )  # fmt: skip
    assert admit(belief, [emps]) == []
    for change, says in ((scaled(1e3), "1e3 times too large"), (scaled(voltage=-1.0), "wrong sign")):
        with pytest.raises(RecordingError, match=says):
            admit(belief, [change(emps)])


def test_a_rotary_axis_is_told_its_angles_in_radians(good: Recording) -> None:
    axis = stage(axis="rotary")
    with pytest.raises(RecordingError, match=r"one direction only \(up, from \S+ to \S+ rad\)"):
        admit(axis, [one_way(good)])
