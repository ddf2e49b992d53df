"""A rotary axis is told in its own units."""

from __future__ import annotations

from recorded import STAGE, run, stage, there_and_back

from rtcomp.diagnosis.pipeline import diagnose
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
