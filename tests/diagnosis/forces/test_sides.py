"""A dead time of the reading and one of the command put the same command beside the same reading."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import RATE, run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.sides import exact
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.physics import Effect, catalogue

KINDS = list(catalogue.entries())
LATE = [k for k in KINDS if k.from_dict(k.example).equivalent() is not None]
ROWS = 1.8


@pytest.mark.parametrize("kind", LATE, ids=lambda k: str(k.name))
def test_what_an_effect_is_at_the_other_side_is_itself_from_there(kind: type[Effect]) -> None:
    one = kind.from_dict(kind.example)
    other = one.equivalent()
    assert other is not None and other.place is not one.place
    assert other.equivalent() == one


@given(st.permutations(KINDS), st.booleans())
def test_effects_stay_in_the_order_of_a_chain_and_only_those_that_are_late_move(
    kinds: list[type[Effect]], held: bool
) -> None:
    effects = [kind.from_dict(kind.example) for kind in kinds]
    found = exact(effects, held)
    assert len(found) == len(effects)
    assert all((a.place, a.order) <= (b.place, b.order) for a, b in pairwise(found))
    late = {str(k.name) for k in LATE}
    assert [e for e in found if e.name not in late] == [
        e for e in sorted(effects, key=lambda e: (e.place, e.order)) if e.name not in late
    ]
    places = {e.place for e in found if e.name in late}
    assert len(places) == 1  # those of the other side have come over
    assert exact(found, held) == found


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("name", [str(k.name) for k in LATE])
def test_a_dead_time_of_a_part_of_a_row_is_either(name: str, held: bool) -> None:
    """Neither can be told from the other, in a loop or not: a name of one alone would be wrong."""
    late = {"name": name, "delay": ROWS / RATE}
    recording = run(stage(effects=[late]), there_and_back(12.0))
    balance = ForceBalance(stage(), load_data([recording], held=held))
    baseline(balance)
    fitter = Fitter(balance)
    both = [fitter.fit([Term.of({"name": str(k.name), "delay": 1.0 / RATE})]) for k in LATE]
    assert both[0].errors == pytest.approx(both[1].errors, rel=1e-4)
    if held:
        assert [m.entries[0]["delay"] for m in both] == pytest.approx([ROWS / RATE] * len(both), rel=0.01)
        assert both[0].sse < 0.05 * float(np.sum(fitter.fit([]).residual[fitter.rows] ** 2))
