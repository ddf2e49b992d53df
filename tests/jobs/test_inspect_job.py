"""`inspect` on the simulated stage: each effect is found by its own test; and on measured recordings."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError, RecordingError
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.inspect import Inspected, inspect
from rtcomp.jobs.simulate import closed_loop
from rtcomp.recording.reader import Recording, read

MOTION = {
    "kind": "minor-loops", "amplitude": 6e-5, "frequency": 0.5, "duration": 26.0,
    "loops": [{"position": 2e-5, "size": 2e-5}, {"position": -2e-5, "size": 1.5e-5}],
}  # fmt: skip


def inspected(leuven: Configuration, *effects: dict[str, object]) -> Inspected:
    """Inspect a run of the shipped stage with hidden effects, believing that there are none."""
    stage = {**leuven.file.data["stage"], "effects": list(effects)}
    run = closed_loop(leuven.changed(stage=stage, reference=MOTION))
    columns = {name: run.columns[name] for name in ("time", "position", "voltage")}
    return inspect(Recording(columns, run.rate_hz, {"rtcomp_version": "test"}), leuven.stage)


def test_the_simulated_stage_is_symmetric_congruent_and_closes(leuven: Configuration) -> None:
    found = inspected(leuven)
    summary = found.summary()
    assert [summary[name]["verdict"] for name in ("symmetry", "congruency", "closure")] == ["holds"] * 3
    assert summary["rate_dependence"]["verdict"] == "not-testable"
    assert summary["symmetry"]["difference_percent"] < 0.2
    # The minor loops are passed over: the major loop is whole.
    assert found.loop is not None and found.loop.length == pytest.approx(1.2e-4, rel=0.02)


def test_asymmetric_friction_is_found_by_the_symmetry_test_and_not_by_the_other(
    leuven: Configuration,
) -> None:
    summary = inspected(leuven, {"name": "asymmetric-friction", "asymmetry": 0.1}).summary()
    assert summary["symmetry"]["verdict"] == "fails"
    assert summary["symmetry"]["difference_percent"] > 20 * summary["symmetry"]["scatter_percent"]
    assert summary["symmetry"]["mean_curve_share"] < 0.2
    assert summary["congruency"]["verdict"] == "holds"


def test_non_congruent_friction_is_found_by_the_congruency_test_and_not_by_the_other(
    leuven: Configuration,
) -> None:
    summary = inspected(leuven, {"name": "non-congruent-friction", "softening": 0.3}).summary()
    assert summary["congruency"]["verdict"] == "fails"
    assert summary["congruency"]["spread_percent"] > 10 * summary["congruency"]["scatter_percent"]
    line = summary["congruency"]["stiffness_with_force"]
    assert line["high_percent"] < 0.0 and line["correlation"] < -0.9
    assert summary["symmetry"]["verdict"] == summary["closure"]["verdict"] == "holds"


def test_a_spring_beside_the_centre_is_an_asymmetry_of_the_mean_curve(leuven: Configuration) -> None:
    knots = list(np.linspace(-1e-4, 1e-4, 21))
    force = {"name": "position-force", "knots": knots, "values": [-1e8 * x**2 for x in knots]}
    summary = inspected(leuven, force).summary()
    assert summary["symmetry"]["verdict"] == "fails"
    assert summary["symmetry"]["mean_curve_share"] > 0.9


def test_viscous_force_is_rate_dependence_where_no_stage_takes_it_off(leuven: Configuration) -> None:
    rate = 500.0
    time = np.arange(20_000) / rate
    frequency = np.where(time < 20.0, 0.5, 2.0)
    position = 5e-5 * np.sin(2 * np.pi * np.cumsum(frequency) / rate)
    model = HysteresisModel(IntervalBasis(np.array([1e-5, 4e-5])), np.array([1e5, 5e4]))
    speed = np.gradient(position, 1.0 / rate)

    def of(viscous: float) -> dict[str, object]:
        columns = {"time": time, "position": position, "voltage": model.response(position) + viscous * speed}
        answer = inspect(Recording(columns, rate)).summary()["rate_dependence"]
        assert isinstance(answer, dict)
        return answer

    assert of(0.0)["verdict"] == "holds"
    assert of(1000.0)["verdict"] == "fails"
    assert of(1000.0)["change_per_doubling"]["percent"] > 0.0  # type: ignore[index]


def test_rows_that_were_not_measured_take_their_branches_with_them(leuven: Configuration) -> None:
    time = np.arange(8000) / 1000.0
    position = 1e-4 * np.sin(2 * np.pi * time)
    columns = {
        "time": time,
        "position": position,
        "voltage": np.sign(np.cos(2 * np.pi * time)) + 1e4 * position,
    }
    whole = inspect(Recording(columns, 1000.0), smoothing_hz=0.0)
    gap = np.zeros(8000)
    gap[3000:3300] = 1.0
    holed = inspect(Recording({**columns, "gap": gap}, 1000.0), smoothing_hz=0.0)
    assert len(holed.branches) == len(whole.branches) - 1
    assert "left out" in holed.notes[-1]


@pytest.mark.parametrize(
    ("position", "voltage", "options", "says"),
    [
        ("ramp", "sine", {}, ["the position only rises", "two reversals", "--reversal"]),
        ("ramp down", "sine", {}, ["the position only falls"]),
        ("once", "sine", {}, ["turns back once", "two reversals"]),
        ("sine", "none", {}, ["the force is 0 all along", "--map voltage=COLUMN"]),
        ("sine", "sine", {"reversal": 2.5}, ["--reversal is 2.5", "the whole stroke only"]),
        ("sine", "sine", {"settle": 3.9}, ["after --settle 3.9 s there is no rising and falling branch"]),
    ],
)  # fmt: skip
def test_what_cannot_be_inspected_is_said(
    position: str, voltage: str, options: dict[str, float], says: list[str]
) -> None:
    time = np.arange(4000) / 1000.0
    made = {
        "ramp": time, "ramp down": -time, "once": -np.abs(time - 2.0), "none": 0.0 * time,
        "sine": np.sin(2 * np.pi * time),
    }  # fmt: skip
    recording = Recording({"time": time, "position": made[position], "voltage": made[voltage]}, 1000.0)
    with pytest.raises(RecordingError) as caught:
        inspect(recording, **options)
    for words in says:
        assert words in str(caught.value)


@pytest.mark.parametrize(("option", "says"), [("smoothing_hz", "[0, 500)"), ("settle", "lasts 3.999 s")])
def test_options_out_of_range_are_named(option: str, says: str) -> None:
    time = np.arange(4000) / 1000.0
    columns = {"time": time, "position": np.sin(time), "voltage": time}
    with pytest.raises(ConfigError, match=rf"--{option.split('_')[0]} is 500") as caught:
        inspect(Recording(columns, 1000.0), **{option: 500.0})
    assert says in str(caught.value)


def test_few_rows_are_named() -> None:
    time = np.arange(40) / 1000.0
    with pytest.raises(RecordingError, match="40 rows; an inspection needs at least 64"):
        inspect(Recording({"time": time, "position": time, "voltage": time}, 1000.0, path=Path("a.csv")))


def test_a_measured_joint(shared_data: Path) -> None:
    config = Configuration.load(Path(__file__).parents[2] / "configs" / "heads_yaw.yaml")
    file = next((shared_data / "real" / "heads-yaw").glob("*.csv.gz"))
    found = inspect(read(file, config.run.recording.map), config.stage)
    # 31 sines of the torque, each a way there and back; the coarse encoder's noise makes no branches.
    assert len(found.branches) + len(found.left_out) == 61
    assert 0.4 < found.sight.smoothing_hz < 0.6
    assert found.symmetry is not None and min(found.symmetry.repeats) >= 6
    assert 2.0 < found.summary()["symmetry"]["difference_percent"] < 6.0


def test_measured_piezo_loops(shared_data: Path) -> None:
    file = shared_data / "real" / "piezo" / "MeasurementData.mat"
    names = {"position": "Vplus_15kv", "voltage": "Displacement_15kv"}
    found = inspect(read(file, names, rate_hz=10.0))
    assert len(found.branches) == 2
    assert found.summary()["symmetry"]["verdict"] == "not-testable"


@given(
    seed=st.integers(0, 2**31),
    motion=st.sampled_from(["walk", "sine", "noise", "counts", "steps", "spikes"]),
    force=st.sampled_from(["position", "noise", "sign", "step", "walk", "cubic"]),
    scale=st.sampled_from([1e-9, 1e-4, 1.0, 1e5]),
    smoothing=st.sampled_from([None, 0.0, 1.0, 49.0]),
)
@settings(max_examples=80, deadline=None)
def test_whatever_is_recorded_there_is_an_answer_or_one_clear_error(
    seed: int, motion: str, force: str, scale: float, smoothing: float | None
) -> None:
    chance = np.random.default_rng(seed)
    rows = int(chance.integers(64, 500))
    time = np.arange(rows) / 100.0
    position = {
        "walk": lambda: np.cumsum(chance.standard_normal(rows)),
        "sine": lambda: np.sin(time * chance.uniform(0.5, 30.0)),
        "noise": lambda: chance.standard_normal(rows),
        "counts": lambda: np.round(3.0 * np.sin(5.0 * time)),
        "steps": lambda: np.repeat(chance.standard_normal(rows // 8 + 1), 8)[:rows],
        "spikes": lambda: np.where(chance.random(rows) < 0.02, 50.0, np.sin(4.0 * time)),
    }[motion]()
    voltage = {
        "position": lambda: position,
        "noise": lambda: chance.standard_normal(rows),
        "sign": lambda: np.sign(np.gradient(position)),
        "step": lambda: 1.0 * (time > time.mean()),
        "walk": lambda: np.cumsum(chance.standard_normal(rows)),
        "cubic": lambda: position**3,
    }[force]()
    columns = {"time": time, "position": scale * position, "voltage": voltage}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            summary = inspect(Recording(columns, 100.0), smoothing_hz=smoothing).summary()
        except RecordingError as error:
            assert "\n" not in str(error)
            return
    for name in ("symmetry", "congruency", "closure", "rate_dependence"):
        assert summary[name]["verdict"] in ("holds", "fails", "undecided", "not-testable")
        assert summary[name]["says"]
