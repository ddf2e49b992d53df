"""Scores against answers worked out by hand."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from rtcomp.trial.calibrate import Grown
from rtcomp.trial.draw import Case, Plan
from rtcomp.trial.figures import Figure, figures, seen
from rtcomp.trial.oracle import Strength
from rtcomp.trial.plant import Loop, Physics
from rtcomp.trial.run import Outcome
from rtcomp.trial.says import Said, match
from rtcomp.trial.score import Errors, Scored, score

PHYSICS = Physics(2.0, 4.0, 10.0, 8.0, 250.0, 5e-3, 4.0, 4e-5, 4.0)
LOOP = Loop(2e4, 2e5, 100.0, 1000.0, 1.5e-8, 1e-8)
DONE = Outcome("case", 0, 3.0, False, "")


def hidden(name: str, share: float = 0.1, floor: float = 0.01, **parameters: float) -> Grown:
    return Grown(name, {}, parameters, Strength(share, share, floor))


def case(kind: str, *effects: Grown, tier: str = "full") -> Case:
    plan = Plan("case", kind, tuple(e.name for e in effects), tier, 1)
    return Case(plan, PHYSICS, PHYSICS, LOOP, {}, {}, effects)


def said(verdict: str, *named: str, unexplained: bool = False, **more: Any) -> Said:
    sets = tuple(tuple(n.split("/")) for n in named)
    return Said(verdict, sets, unexplained or verdict == "unexplained", **more)


def scored(of: Case, what: Said | None, errors: Errors | None = None) -> Scored:
    return score(of, DONE, what, "", errors)


LAG = case("one", hidden("drive-lag"))
COGGING = case("one", hidden("cogging", period=1e-3))


@pytest.mark.parametrize(
    ("of", "what", "right", "first", "held"),
    [
        (COGGING, said("missing-physics", "cogging"), True, True, True),
        (COGGING, said("missing-physics", "cogging/torque-ripple"), False, True, True),
        (COGGING, said("missing-physics", "torque-ripple/cogging"), False, False, True),
        (COGGING, said("missing-physics", "stribeck", "cogging"), False, False, True),
        (COGGING, said("missing-physics", "stribeck"), False, False, False),
        (COGGING, said("unexplained"), False, False, False),
        (COGGING, said("consistent"), False, False, False),
        (LAG, said("missing-physics", "sensor-delay/drive-delay"), True, True, True),
        (case("one", hidden("gravity")), said("missing-physics", "drive-offset"), True, True, True),
        (case("one", hidden("inertia")), said("retuned", moved=("mass",)), True, True, True),
        (case("one", hidden("inertia")), said("retuned", moved=("viscous",)), False, False, False),
        (case("one", hidden("drive-gain")), said("retuned", moved=("friction",)), True, True, True),
        (case("one", hidden("drive-gain")), said("retuned", moved=("mass",)), True, True, True),
        (case("one", hidden("drive-gain")), said("retuned", moved=("micro_damping",)), False, False, False),
        (case("one", hidden("stribeck")), said("retuned", moved=("stribeck",)), True, True, True),
    ],
)  # fmt: skip
def test_one_effect(of: Case, what: Said, right: bool, first: bool, held: bool) -> None:
    result = scored(of, what)
    assert (result.right, result.matches[0].first, result.matches[0].held) == (right, first, held)


@pytest.mark.parametrize(
    ("what", "right"),
    [
        (said("consistent"), True),
        (said("retuned"), True),
        (said("missing-physics", "stribeck"), False),
        (said("retuned", "stribeck"), False),
        (said("unexplained"), False),
    ],
)
def test_clean(what: Said, right: bool) -> None:
    result = scored(case("clean"), what)
    assert result.right == right == result.quiet


@pytest.mark.parametrize(
    ("shape", "what", "right", "misnamed"),
    [
        ("outside-speed-bump", said("unexplained"), True, False),
        ("outside-speed-bump", said("missing-physics", "stribeck", unexplained=True), False, True),
        ("outside-speed-bump", said("missing-physics", "stribeck"), False, True),
        ("outside-speed-bump", said("consistent"), False, False),
        ("outside-force-bump", said("missing-physics", "position-force"), True, False),
        ("outside-speed-bump", said("missing-physics", "position-force"), False, True),
    ],
)
def test_outside(shape: str, what: Said, right: bool, misnamed: bool) -> None:
    result = scored(case("outside", hidden(shape)), what)
    assert (result.right, bool(result.wrong)) == (right, misnamed)


def test_two_effects_need_two_names_and_no_third() -> None:
    both = case("two", hidden("cogging"), hidden("gravity"))
    assert scored(both, said("missing-physics", "constant-force", "cogging")).right
    assert not scored(both, said("missing-physics", "cogging")).right
    third = scored(both, said("missing-physics", "cogging", "gravity", "stribeck"))
    assert not third.right and third.wrong == (("stribeck",),)
    assert (
        match(said("missing-physics", "gravity"), (hidden("gravity"), hidden("drive-offset")))[0][1].found
        is False
    )


def test_aliases_that_nobody_can_tell_apart_count_as_one_name() -> None:
    three = scored(
        case("one", hidden("gravity")), said("missing-physics", "drive-offset/gravity/constant-force")
    )
    more = scored(COGGING, said("missing-physics", "cogging/torque-ripple"))
    assert (three.matches[0].size, three.matches[0].choices) == (3, 1)
    assert (more.matches[0].size, more.matches[0].choices) == (2, 2)


def test_a_parameter_retuned_to_the_truth_is_found_however_little_it_moved() -> None:
    """A belief that was off the same way as what is hidden leaves little to move."""
    heavy = replace(hidden("inertia"), changes={"mass": 2.4})
    assert scored(case("one", heavy), said("retuned", retuned={"mass": (2.38, 2.3, 2.5)})).right
    assert not scored(case("one", heavy), said("retuned", retuned={"mass": (2.1, 2.0, 2.2)})).right


@pytest.mark.parametrize(
    ("name", "what", "right"),
    [
        ("retuned-mass", said("retuned"), True),
        ("retuned-mass", said("missing-physics", "inertia"), True),
        ("retuned-mass", said("missing-physics", "stribeck"), False),
        ("retuned-friction-reach", said("retuned"), True),
        ("retuned-friction-reach", said("consistent"), False),
        ("retuned-friction-reach", said("missing-physics", "backlash"), False),
    ],
)
def test_retuned(name: str, what: Said, right: bool) -> None:
    assert scored(case("retuned", hidden(name)), what).right == right


def test_a_failed_diagnosis_counts_as_nothing_found() -> None:
    result = scored(COGGING, None)
    assert not result.right and not result.quiet and not result.matches[0].held
    assert {f.name: f.value for f in figures([result])}["diagnosis failed"] == 1.0


def test_gain_is_of_squares_and_compared_with_the_oracle() -> None:
    result = scored(COGGING, said("missing-physics", "cogging"), Errors(0.1, 0.02, 0.01))
    assert result.gain == pytest.approx(0.96)
    assert result.gain_over_oracle == pytest.approx(0.96 / 0.99)
    assert scored(COGGING, said("consistent"), Errors(0.0105, 0.01, 0.01)).gain_over_oracle is None


def test_estimates_count_only_where_the_truth_is_known() -> None:
    values = {"cogging": {"period": (1.01e-3, 0.9e-3, 1.1e-3), "phase": (1.0, 0.0, 2.0)}}
    what = said("missing-physics", "cogging", intervals=values, retuned={"mass": (2.1, 2.05, 2.2)})
    result = scored(COGGING, what)
    assert {(e.effect, e.parameter): e.covered for e in result.estimates} == {
        ("cogging", "period"): True,
        ("stage", "mass"): False,
    }
    scaled = replace(COGGING, physics=PHYSICS._replace(force_constant=5.0))
    assert [e.parameter for e in scored(scaled, what).estimates] == ["period"]


def test_figures_are_of_detectable_effects_and_tell_their_counts() -> None:
    faint = case("one", hidden("cogging", share=0.001))
    rows = [
        scored(COGGING, said("missing-physics", "cogging"), Errors(0.1, 0.01, 0.01)),
        scored(faint, said("consistent"), Errors(0.01, 0.02, 0.01)),
        scored(case("clean"), said("consistent"), Errors(0.01, 0.01, 0.01)),
    ]
    found = {f.name: f for f in figures(rows)}
    assert found["named first, one effect"].value == 1.0 and found["named first, one effect"].count == 1
    assert found["made worse"].value == pytest.approx(1 / 3) and found["made worse"].met is False
    assert found["false alarm on clean"].met is True
    assert found["both of two named"].met is None and found["both of two named"].count == 0
    assert found["right, all cases"].value == pytest.approx(2 / 3)
    json.dumps([f.to_json() for f in found.values()], allow_nan=False)


def test_smallest_strength_seen_by_tier() -> None:
    rows = [
        scored(case("one", hidden("cogging", share)), said("missing-physics", *(["cogging"] if hit else [])))
        for share, hit in [(0.2, True), (0.1, True), (0.05, False), (0.02, True)]
    ]
    full, weak = seen(rows)
    assert (full.cases, full.found, full.smallest, full.surely) == (4, 3, 0.02, 0.1)
    assert weak.cases == 0 and math.isnan(weak.smallest)


def test_wilsons_interval() -> None:
    """Against Wilson (1927) as tabulated: 9 of 10 lie between 59.6 and 98.2 %."""
    assert Figure("part", 0.9, 10).interval == pytest.approx((0.596, 0.982), abs=1e-3)


def test_a_diagnosis_is_read_as_the_format_has_it(tmp_path: Path) -> None:
    path = tmp_path / "diagnosis.json"
    value = {"value": 1.0, "low": 0.9, "high": 1.1, "unit": "m"}
    data = {
        "verdict": "missing-physics",
        "retuned": [{"parameter": "friction.level", "from": 4.0, "to": 5.0, "low": 4.9, "high": 5.1}],
        "effects": [
            {"names": ["cogging", "torque-ripple"], "parameters": {"period": value}},
            {"names": ["unexplained"]},
        ],
    }  # fmt: skip
    path.write_text(json.dumps(data))
    read = Said.read(path)
    assert read.named == (("cogging", "torque-ripple"),) and read.unexplained
    assert read.moved == ("friction",) and read.intervals == {"cogging": {"period": (1.0, 0.9, 1.1)}}
    for broken in ("", "[]", '{"verdict": "consistent"}', '{"verdict": 1, "effects": [{}], "retuned": []}'):
        path.write_text(broken)
        with pytest.raises(ValueError):
            Said.read(path)
