"""Stated probability against frequency, counted by hand."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rtcomp.report.diagnosis_words import probability
from rtcomp.trial.calibrate import Grown
from rtcomp.trial.calibration import BINS, calibration
from rtcomp.trial.draw import Case, Plan
from rtcomp.trial.oracle import Strength
from rtcomp.trial.plant import Loop, Physics
from rtcomp.trial.run import Outcome
from rtcomp.trial.says import Said, match
from rtcomp.trial.score import Scored, score

PHYSICS = Physics(2.0, 4.0, 10.0, 8.0, 250.0, 5e-3, 4.0, 4e-5, 4.0)
LOOP = Loop(2e4, 2e5, 100.0, 1000.0, 1.5e-8, 1e-8)


def scored(hidden: str, *said: tuple[str, float], form: str = "", family: str = "micrometre") -> Scored:
    grown = Grown(hidden, {}, {"period": 1e-3, "amplitude": 2.0}, Strength(0.1, 0.1, 0.01), form=form)
    case = Case(Plan("case", "one", (hidden,), "full", 1, family), PHYSICS, PHYSICS, LOOP, {}, {}, (grown,))
    value = (1e-3, 0.9e-3, 1.1e-3)
    what = Said(
        "missing-physics", tuple((name,) for name, _ in said), False,
        intervals={name: {"period": value, "amplitude": value} for name, _ in said},
        probabilities=tuple(p for _, p in said),
    )  # fmt: skip
    return score(case, Outcome("case", 0, 1.0, False, ""), what, "", None)


def test_names_are_counted_by_what_was_stated() -> None:
    rows = [
        scored("cogging", ("cogging", 0.999)),
        scored("cogging", ("cogging", 1.0), ("stribeck", 0.999)),
        scored("cogging", ("stribeck", 0.97)),
        scored("cogging", ("cogging", 0.6)),
    ]
    found = {stated.says: stated for stated in calibration(rows)}
    assert (found["above 0.99"].count, found["above 0.99"].right) == (3, 2)
    assert (found["0.95 to 0.99"].count, found["0.95 to 0.99"].right) == (1, 0)
    assert found["0.5 to 0.8"].mean == pytest.approx(0.6) and found["below 0.5"].mean is None
    assert sum(stated.count for stated in found.values()) == 5
    json.dumps([stated.to_json() for stated in found.values()], allow_nan=False)


def test_above_099_is_what_the_report_calls_so() -> None:
    low = BINS[0][1]
    assert probability(low + 1e-6) == BINS[0][0] != probability(low - 1e-6)


def test_of_another_form_only_the_period_has_a_true_value() -> None:
    said = ("cogging", 0.99)
    assert {e.parameter for e in scored("cogging", said).estimates} == {"period", "amplitude"}
    assert {e.parameter for e in scored("cogging", said, form="triangle").estimates} == {"period"}
    assert not scored("stribeck", ("stribeck", 0.99), form="power").estimates


def test_on_a_rotary_axis_weight_is_no_constant_force() -> None:
    for family, found in (("micrometre", True), ("geared-joint", False)):
        assert scored("gravity", ("constant-force", 0.9), family=family).matches[0].found == found
        assert scored("constant-force", ("drive-offset", 0.9), family=family).matches[0].found
    assert scored("gravity", ("gravity", 0.9), family="geared-joint").matches[0].found


def test_a_number_of_a_believed_effect_that_was_zero_is_moved_by_an_interval_without_zero(
    tmp_path: Path,
) -> None:
    path = tmp_path / "diagnosis.json"
    for low, moved in ((2e3, ("parallel-spring",)), (-1.0, ())):
        entry = {"parameter": "parallel-spring.cubic", "from": 0.0, "to": 5e3, "low": low, "high": 8e3}
        path.write_text(json.dumps({"verdict": "retuned", "retuned": [entry], "effects": []}))
        said = Said.read(path)
        assert said.moved == moved
        hidden = Grown("parallel-spring", {}, {}, Strength(0.1, 0.1, 0.01))
        assert match(said, (hidden,))[0][0].found == bool(moved)


def test_probabilities_are_read_beside_their_names(tmp_path: Path) -> None:
    effects = [
        {"names": ["unexplained"], "probability": 0.5},
        {"names": ["cogging"], "probability": 0.98},
        {"names": ["stribeck"]},
    ]
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps({"verdict": "missing-physics", "retuned": [], "effects": effects}))
    said = Said.read(path)
    assert said.named == (("cogging",), ("stribeck",)) and said.probabilities == (0.98, None)
