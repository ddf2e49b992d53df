"""Friction that is believed as a model of the catalogue is one unit of the balance, as large as it fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.stage_of import friction_in
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.physics import catalogue

MODELS = ("dahl", "lugre", "gms", "leuven", "modified-leuven")


def model(name: str) -> dict[str, object]:
    return {"model": name, **catalogue.entry(name).example}


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("larger", [1.0, 1.15])
def test_its_size_is_found_and_written(name: str, larger: float) -> None:
    """Forces so many times as large are the same model with other forces and stiffnesses."""
    believed, true = stage(friction=model(name)), stage(friction=friction_in("N", model(name), larger))
    balance = ForceBalance(believed, load_data([run(true, there_and_back(8.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    assert fitter.relative(base, seen=True) < 0.02
    held = (
        base.coefficients[balance.friction] @ balance.reaches
        + base.coefficients[balance.model] @ balance.models
    )
    assert held == pytest.approx(larger * balance.models[0], rel=0.03)
    written = fitter.stage(base)
    assert written.friction is not None and written.friction.name == name
    drive, needed = balance.both_sides(written)
    assert np.std(drive - needed) < 0.02 * np.std(drive)


def test_behind_a_play_stop_elements_have_its_place() -> None:
    hidden = {"name": "backlash", "gap": 4e-6}
    recording = run(stage(friction=model("leuven"), effects=[hidden]), there_and_back(8.0))
    believed = stage(friction=model("leuven"))
    balance = ForceBalance(believed, load_data([recording]))
    baseline(balance)
    fitter = Fitter(balance)
    found = fitter.fit([Term.of(hidden)])
    assert fitter.relative(found) < 0.5 * fitter.relative(fitter.fit([]))
    nothing = found.coefficients.copy()
    nothing[balance.model] = 0.0
    written = fitter.stage(replace(found, coefficients=nothing)).friction
    assert written is not None and written.name == "maxwell-slip"


@pytest.mark.parametrize("name", ["lugre", "leuven"])
def test_what_is_hidden_beside_it_is_named_alone(name: str) -> None:
    hidden = {"name": "cogging", "amplitude": 1.0, "period": 7e-5, "phase": 0.3}
    recording = run(stage(friction=model(name), effects=[hidden]), there_and_back(16.0))
    found = diagnose(stage(friction=model(name)), [recording], budget=200.0)
    assert [m.names for m in found.effects] == [("cogging",)]
    assert found.stage.friction is not None and found.stage.friction.name == name
    nothing = run(stage(friction=model(name)), there_and_back(16.0))
    assert diagnose(stage(friction=model(name)), [nothing], budget=200.0).verdict == "consistent"
