"""Growing a model by its best candidates: in the form that fits, where first order does not tell forms."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.candidates.growing import grow, likeliest
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.starting import FULL, STARTS, as_they_are
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.selection import look
from rtcomp.diagnosis.search.ways import Left, least_left

STRIBECK = {"name": "stribeck", "rise": 0.4, "velocity": 1.5e-3}


@pytest.mark.parametrize("following", [0.0, 1.0])
def test_an_effect_is_grown_in_the_form_that_it_has(following: float) -> None:
    """How what sticks follows a level that changes late is of second order: a full fit tells it."""
    believed = stage(effects=[STRIBECK])
    late = {"name": "frictional-lag", "time_constant": 0.02, "following": following}
    recording = run(stage(effects=[STRIBECK, late]), there_and_back(16.0))
    balance = ForceBalance(believed, load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    found = look(fitter, base)
    grown = grow(fitter, base, found.candidates, found.screened, math.inf)
    best = min(grown, key=lambda model: model.sse).entries[0]
    assert best["name"] == "frictional-lag"
    assert best["following"] == following
    assert best["time_constant"] == pytest.approx(late["time_constant"], rel=0.1)
    # Where another way to take the command had it in the other form, this one still finds its own.
    other = Term.of({**best, "following": 1.0 - following})
    blocks = ~balance.reserved
    own = Left.by(fitter, min(grown, key=lambda model: model.sse), blocks)
    assert least_left(fitter, [other], blocks, math.inf).weighed == pytest.approx(own.weighed, abs=0.3)


@pytest.mark.parametrize("onset", [0.01, 0.2])
def test_how_long_a_rest_takes_to_matter_is_found_with_ageing(onset: float) -> None:
    aged = {"name": "stiction-ageing", "growth": 0.2, "distance": 2e-5, "onset": onset, "following": 1.0}
    balance = ForceBalance(stage(), load_data([run(stage(effects=[aged]), there_and_back(16.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    found = look(fitter, base)
    grown = grow(fitter, base, found.candidates, found.screened, math.inf)
    best = min(grown, key=lambda model: model.sse).entries[0]
    assert best["name"] == "stiction-ageing"
    assert {n: best[n] for n in aged if n != "name"} == pytest.approx(
        {n: v for n, v in aged.items() if n != "name"}, rel=0.15
    )


@given(st.lists(st.lists(st.floats(1e-3, 9.0), min_size=1, max_size=4), max_size=6))
def test_of_the_likeliest_starts_that_is_taken_which_leaves_least(errors: list[list[float]]) -> None:
    families = [[Term.of({"name": "drive-lag", "time_constant": e}) for e in family] for family in errors]
    found = as_they_are(lambda term: float(term.entry["time_constant"]), families, math.inf)
    assert [t.entry["time_constant"] for t in found] == [min(family[:STARTS]) for family in errors]
    late = as_they_are(lambda term: float(term.entry["time_constant"]), families, -math.inf)
    assert late == [family[0] for family in families]


def test_a_size_that_first_order_makes_larger_than_it_may_be_is_tried_at_half() -> None:
    drift = Term.of({"name": "friction-drift", "change": -FULL, "time_constant": 9.0})
    for true, taken in ((-0.5, -0.5 * FULL), (-0.8, -FULL)):
        (found,) = as_they_are(lambda t, true=true: abs(float(t.entry["change"]) - true), [[drift]], math.inf)
        assert found.entry["change"] == pytest.approx(taken)


@given(st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(0.0, 9.0)), max_size=6, unique=True))
def test_starts_are_sorted_by_gain_but_the_smallest_error_is_among_the_first_two(
    some: list[tuple[float, float]],
) -> None:
    found = likeliest(some, lambda one: one[0], lambda one: one[1])
    assert sorted(found) == sorted(some)
    if some:
        assert found[0][0] == max(gain for gain, _ in some)
        assert min(left for _, left in found[:STARTS]) == min(left for _, left in some)
    rest = found[2:]
    assert rest == sorted(rest, key=lambda one: -one[0])


def test_each_effect_is_fitted_before_any_in_another_form() -> None:
    """A fit finds another form by itself, and no other effect: forms of one must not keep others out."""
    asked: list[list[str]] = []

    class Watched(Fitter):
        def rough(
            self, model: Fitted, families: Sequence[Sequence[Term]], count: int, ends: float
        ) -> list[Term]:
            asked.append([str(family[0].entry["name"]) for family in families])
            return []

    balance = ForceBalance(stage(), load_data([run(stage(effects=[STRIBECK]), there_and_back(12.0))]))
    base, fitter = baseline(balance), Watched(balance)
    found = look(fitter, base)
    grow(fitter, base, found.candidates, found.screened, -math.inf)
    names = asked[0]
    assert len(names) > len(set(names))
    assert len(set(names[: len(set(names))])) == len(set(names))
