"""What a coarse sensor bends a fit by is taken from its numbers, as replicates tell it."""

from __future__ import annotations

import cmath
from pathlib import Path

import numpy as np
import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.unbiased import numbers_of, unbiased
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.recording.reader import Recording
from rtcomp.stage.stage import Stage
from rtcomp.trial.draw import Case, Plan, draw

SPRING = {"name": "parallel-spring", "stiffness": 3000.0}


@pytest.fixture(scope="module")
def spring() -> tuple[Fitter, list[Term]]:
    axis = stage(effects=[SPRING])
    balance = ForceBalance(stage(), load_data([run(axis, there_and_back())]))
    baseline(balance)
    return Fitter(balance), [Term.of({**SPRING, "stiffness": 1.0})]


def test_what_replicates_are_off_by_is_taken_from_the_fit(spring: tuple[Fitter, list[Term]]) -> None:
    fitter, terms = spring
    model = fitter.fit(terms)
    own, size = numbers_of(fitter, model), fitter.balance.size
    assert own == pytest.approx(model.coefficients, rel=1e-4)  # nothing of it is nonlinear
    off = np.zeros((4, own.size))
    off[:, 0], off[:, size] = 0.1 * own[0], 200.0
    found = unbiased(fitter, model, own + off)
    assert found.coefficients[0] == pytest.approx(0.9 * model.coefficients[0], rel=1e-3)
    moved = float(found.entries[0]["stiffness"]) - float(model.entries[0]["stiffness"])
    assert moved == pytest.approx(-200.0, rel=0.01)
    same = unbiased(fitter, model, own[None])
    assert same.entries[0]["stiffness"] == pytest.approx(model.entries[0]["stiffness"], rel=1e-4)
    assert same.residual == pytest.approx(model.residual, abs=1e-3 * np.abs(model.residual).max())


def test_friction_without_bias_keeps_its_shape(spring: tuple[Fitter, list[Term]]) -> None:
    fitter, terms = spring
    model = fitter.fit(terms)
    units = fitter.balance.friction
    off = numbers_of(fitter, model)
    off[units] *= 1.25
    found = unbiased(fitter, model, off[None]).coefficients[units]
    assert found == pytest.approx(0.75 * model.coefficients[units], rel=1e-3)


def weighty(seed: int) -> tuple[Case, Stage, Recording]:
    """A geared joint with a pendulum and a 12-bit encoder, its belief without the weight, its recording."""
    case = draw(Plan("joint", "clean", (), "full", seed, "geared-joint"))
    assert case.physics.pendulum
    ran, content = case.run("train"), {**case.believed, "stage": dict(case.believed["stage"])}
    del content["stage"]["effects"]
    columns = {name: getattr(ran, name) for name in ("time", "reference", "position", "voltage")}
    return case, Stage.from_dict(content), Recording(columns, case.loop.rate, {}, Path("joint.csv"))


@pytest.mark.parametrize("seed", [2, 119])
def test_a_weight_seen_by_a_coarse_encoder_is_named_and_right(seed: int) -> None:
    case, believed, recording = weighty(seed)
    found = diagnose(believed, [recording], budget=120.0)
    assert [e.names for e in found.effects] == [("gravity",)]
    told = found.effects[0].parameters
    weight = cmath.rect(told["amplitude"].value, told["phase"].value)
    true = cmath.rect(case.physics.pendulum, case.physics.pendulum_phase)
    assert abs(weight - true) < 0.02 * abs(true)  # a fit alone is 3.6 and 4.6 % off
    assert told["amplitude"].low <= abs(true) <= told["amplitude"].high
