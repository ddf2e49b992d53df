"""The engine on recordings made here: what was hidden is named, and nothing where nothing was hidden."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from recorded import at_hand

from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.result import Diagnosis
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.simulate import closed_loop
from rtcomp.recording.reader import Recording, read
from rtcomp.stage.stage import Stage

REFERENCE = {
    "kind": "multisine", "frequencies": [0.23, 0.71, 1.9, 4.3], "amplitudes": [2.5e-4, 1.2e-4, 6e-5, 1.5e-5],
    "duration": 24.0,
}  # fmt: skip


def recorded(hidden: dict[str, Any] | None, **mechanics: Any) -> tuple[Stage, Recording]:
    config = Configuration.load(shipped("leuven.yaml"))
    changes: dict[str, Any] = dict(mechanics)
    if hidden is not None:
        changes["effects"] = [hidden]
    plant = config.stage.with_changes(stage=changes) if changes else config.stage
    run = closed_loop(config.changed(**plant.to_dict(), reference=REFERENCE))
    columns = {k: run.columns[k] for k in ("time", "reference", "position", "voltage")}
    return config.stage, Recording(columns, run.rate_hz)


COGGING = {"name": "cogging", "amplitude": 0.5, "period": 1.3e-4, "phase": 0.4}


def diagnosed(hidden: dict[str, Any] | None, **mechanics: Any) -> Diagnosis:
    stage, recording = recorded(hidden, **mechanics)
    return diagnose(stage, [recording], budget=300.0)


@pytest.fixture(scope="module")
def cogging() -> Diagnosis:
    return diagnosed(COGGING)


def test_nothing_is_named_where_nothing_is_missing() -> None:
    done = diagnosed(None)
    assert done.verdict == "consistent"
    assert not done.effects


@pytest.mark.slow
def test_a_spring_of_another_law_is_not_only_a_wave_that_was_not_seen_to_repeat() -> None:
    """With the square of the position: the command that moves the axis alike against it."""
    axis, recording = recorded(None, effects=[{"name": "parallel-spring", "stiffness": 3000.0}])
    x = recording.position
    force = 2.0 * x * np.abs(x) / np.max(x**2)
    pushed = {**recording.columns, "voltage": recording.voltage + force / axis.force_constant}
    believed = axis.with_changes(stage={"effects": [{"name": "parallel-spring", "stiffness": 3000.0}]})
    done = diagnose(believed, [Recording(pushed, recording.rate_hz)], budget=300.0)
    assert done.verdict == "missing-physics"
    assert all("parallel-spring" in effect.names for effect in done.effects)


@pytest.mark.slow
def test_other_values_of_what_is_believed_are_retuned_not_named() -> None:
    done = diagnosed(None, mass=2.15, viscous=8.6)
    assert done.verdict in ("retuned", "consistent")
    assert not done.effects
    assert done.fit.after <= done.fit.before


def check_named(done: Diagnosis, hidden: dict[str, Any]) -> None:
    assert done.verdict == "missing-physics"
    assert hidden["name"] in done.effects[0].names
    assert done.fit.after < 0.3 * done.fit.before
    assert any(e["name"] == done.effects[0].names[0] for e in done.stage.mechanics.effects)
    assert done.where, "the place of so large a mismatch shows"
    for name, value in done.effects[0].parameters.items():
        assert value.low <= value.value <= value.high, name


def test_cogging_is_named_and_the_extended_stage_has_it(cogging: Diagnosis) -> None:
    check_named(cogging, COGGING)


@pytest.mark.slow
@pytest.mark.parametrize(
    "hidden",
    [
        {"name": "drive-deadband", "width": 0.2},
        {"name": "asymmetric-friction", "asymmetry": 0.12},
        {"name": "parallel-spring", "stiffness": 4000.0},
        {"name": "position-dependent-friction", "amplitude": 0.25, "period": 2.5e-4, "phase": 1.0},
        {"name": "drive-offset", "offset": 0.2},
    ],
    ids=lambda h: h["name"],
)
def test_what_was_hidden_is_named_and_the_extended_stage_has_it(hidden: dict[str, Any]) -> None:
    done = diagnosed(hidden)
    check_named(done, hidden)
    assert any("and not beyond" in note for note in done.notes)


def test_cogging_is_found_with_its_size_and_period(cogging: Diagnosis) -> None:
    found = cogging.effects[0].parameters
    assert found["amplitude"].value == pytest.approx(0.5, rel=0.03)
    assert found["period"].value == pytest.approx(1.3e-4, rel=0.01)
    assert np.cos(found["phase"].value - 0.4) > 0.99


def emps(budget: float) -> Diagnosis:
    """Return what is said of the measured drive; skip the test where its recording is not at hand."""
    path = at_hand("real/emps/DATA_EMPS.mat")
    columns = {"time": "t", "reference": "qg", "position": "qm", "voltage": "vir"}
    return diagnose(Stage.load(shipped("emps_belief.yaml")), [read(path, columns)], budget=budget)


@pytest.mark.slow
def test_emps_ends_below_its_authors_refit() -> None:
    done = emps(300.0)
    assert "asymmetric-viscous-friction" in {n for e in done.effects for n in e.names}
    assert done.fit.after < 0.0311


@pytest.mark.slow
@pytest.mark.parametrize("budget", [20.0, 55.0])
def test_an_answer_that_was_cut_short_predicts_no_worse_than_the_refitted_stage(budget: float) -> None:
    """Friction is settled on the model of each step: one that is given up must leave nothing behind."""
    done = emps(budget)
    assert done.fit.after <= 1.01 * done.fit.retuned


@pytest.mark.slow
def test_hysteresis_of_the_bouc_wen_benchmark_is_named_from_a_linear_belief() -> None:
    """Its stage says nothing of the noise, and a filter near half the rate hides how much there is."""
    path = at_hand("real/bouc-wen/train.csv.gz")
    section = {"mass": 2.0, "viscous": 10.0, "force_constant": 1.0, "voltage_limit": 1000.0}
    spring = {"name": "parallel-spring", "stiffness": 1e5}
    believed = Stage.from_dict({"stage": {**section, "effects": [spring]}})
    done = diagnose(believed, [read(path, {"voltage": "force"})], budget=300.0)
    assert [e.names for e in done.effects] == [("bouc-wen",)]
