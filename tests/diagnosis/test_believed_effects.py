"""Effects that the stage is believed to have, with other numbers than believed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from recorded import STAGE, run
from rtcomp.diagnosis.believed_effects import Parted
from rtcomp.diagnosis.motion import prepare
from test_alike import reference

from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.result import Diagnosis
from rtcomp.stage.stage import Stage

COGGING: dict[str, Any] = {"name": "cogging", "amplitude": 0.4, "period": 1.3e-4, "phase": 0.4}
DEAD: dict[str, Any] = {"name": "drive-deadband", "width": 0.15}


def axis(*effects: dict[str, Any]) -> Stage:
    """The stage with these effects."""
    return Stage.from_dict({**STAGE, "stage": {**STAGE["stage"], "effects": list(effects)}})


def told(believed: Stage, plant: Stage) -> Diagnosis:
    return diagnose(believed, [run(plant, reference(), seed=5)])


def check_retuned(done: Diagnosis) -> None:
    """It holds the amplitude and the phase of `COGGING`, found from those of another wave."""
    moved = {r.parameter: r for r in done.retuned}
    for name in ("amplitude", "phase"):
        found = moved[f"cogging.{name}"].after
        assert found.low <= COGGING[name] <= found.high, name
    assert "cogging.period" not in moved
    effects = [e for e in done.stage.mechanics.effects if e["name"] == "cogging"]
    assert len(effects) == 1
    assert effects[0]["amplitude"] == pytest.approx(0.4, rel=0.03)


def test_other_numbers_of_a_believed_effect_are_no_missing_physics() -> None:
    done = told(axis({**COGGING, "amplitude": 0.3, "phase": 0.6}), axis(COGGING))
    assert done.verdict == "retuned" and not done.effects
    check_retuned(done)
    assert done.fit.after < 0.2 * done.fit.before
    assert any("periodic in position" in place.says for place in done.where)


@pytest.mark.slow
def test_beside_other_numbers_what_is_missing_is_named() -> None:
    done = told(axis({**COGGING, "amplitude": 0.3, "phase": 0.6}), axis(COGGING, DEAD))
    assert [e.names for e in done.effects] == [("drive-deadband",)]
    assert done.effects[0].parameters["width"].value == pytest.approx(0.15, rel=0.05)
    check_retuned(done)


@pytest.mark.slow
def test_a_believed_effect_does_not_do_for_what_is_missing() -> None:
    done = told(axis(COGGING), axis(COGGING, {**COGGING, "period": 4.1e-5, "amplitude": 0.3}))
    assert [e.names for e in done.effects] == [("cogging",)]
    assert done.effects[0].parameters["period"].value == pytest.approx(4.1e-5, rel=0.01)
    assert not any(r.parameter.startswith("cogging") for r in done.retuned)


@pytest.mark.slow
def test_a_right_belief_is_left_as_it_is() -> None:
    right = axis(COGGING, DEAD)
    done = told(right, right)
    assert done.verdict == "consistent" and not done.retuned


def test_a_stage_is_taken_apart_and_put_together() -> None:
    offset: dict[str, Any] = {"name": "drive-offset", "offset": 0.1}
    motion = prepare(axis(), [run(axis(), reference(), seed=5)])
    parted = Parted.of(axis(COGGING, offset, DEAD), motion)
    assert [e["name"] for e in parted.known] == ["cogging", "drive-deadband"]
    assert [e["name"] for e in parted.bare.mechanics.effects] == ["drive-offset"]  # a number of the base
    again = parted.whole(parted.known)
    assert sorted(str(e["name"]) for e in again.mechanics.effects) == [
        "cogging", "drive-deadband", "drive-offset",
    ]  # fmt: skip
    refined = parted.refined(motion, _fitted(axis(), motion), [])
    assert np.isfinite(refined.errors).all() and len(refined.entries) == 2


def _fitted(stage: Stage, motion: Any) -> Any:
    from rtcomp.diagnosis.base import fit_base

    return fit_base(stage, motion)
