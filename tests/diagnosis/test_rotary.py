"""A rotary axis is told in its own units."""

from __future__ import annotations

import pytest
from recorded import STAGE, run, stage, there_and_back

from rtcomp.diagnosis.candidates.effects import candidates
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.stage.stage import Stage


def test_what_is_retuned_and_named_has_the_units_of_the_axis() -> None:
    spring = {"name": "parallel-spring", "stiffness": 4000.0}
    hidden = {**STAGE["stage"], "axis": "rotary", "mass": 2.5, "effects": [spring]}
    recording = run(Stage.from_dict({**STAGE, "stage": hidden}), there_and_back(20.0))
    found = diagnose(stage(axis="rotary"), [recording], budget=300.0)
    assert {r.parameter: r.after.unit for r in found.retuned}["mass"] == "kg m^2"
    (named,) = found.effects
    assert "parallel-spring" in named.names  # within so small an angle a weight is a spring too
    units = {name: value.unit for name, value in named.parameters.items()}
    assert units.get("stiffness", "N m/rad") == "N m/rad"
    assert units.get("force", "N m") == "N m"


@pytest.mark.parametrize(
    ("axis", "own", "other"), [("linear", "force", "amplitude"), ("rotary", "amplitude", "force")]
)
def test_a_weight_is_a_force_on_a_linear_axis_and_a_moment_on_a_rotary_one(
    axis: str, own: str, other: str
) -> None:
    believed = stage(axis=axis)
    balance = ForceBalance(believed, load_data([run(believed, there_and_back(20.0))]))
    fitted = baseline(balance)
    made = [c.term.entry for c in candidates(Fitter(balance), fitted) if c.name == "gravity"]
    assert made and all(own in entry and other not in entry for entry in made)
    beside = Fitter(balance).fit([Term.of({"name": "constant-force", "force": 0.1})], fitted)
    names = {c.name for c in candidates(Fitter(balance), beside, ["constant-force"])}
    assert ("gravity" in names) == (axis == "rotary")
