"""Two models are told apart where a recording of the other would not look as the recorded one does."""

from __future__ import annotations

import math

import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis import clock
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.confidence import alternatives
from rtcomp.diagnosis.search.selection import Search
from rtcomp.diagnosis.search.separate import separate

STRIBECK = {"name": "stribeck", "rise": 0.4, "velocity": 1.5e-3}
DRAG = {"name": "quadratic-drag", "coefficient": 400.0}


@pytest.fixture(scope="module")
def fitted() -> tuple[Fitter, Fitted, Fitted]:
    """A recording of friction that falls with speed; that and a drag, fitted to it."""
    balance = ForceBalance(stage(), load_data([run(stage(effects=[STRIBECK]), there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    return fitter, *(fitter.fit([Term.of(entry)], base) for entry in (STRIBECK, DRAG))


def test_the_true_model_is_told_from_another_and_not_from_itself(
    fitted: tuple[Fitter, Fitted, Fitted],
) -> None:
    fitter, true, other = fitted
    assert separate(fitter, true, other, 0.05)
    assert not separate(fitter, true, true, 0.05)


def test_a_worse_model_is_not_told_from_a_better_one(fitted: tuple[Fitter, Fitted, Fitted]) -> None:
    """On recordings of the true one that is better as well."""
    fitter, true, other = fitted
    assert not separate(fitter, other, true, 0.05)


def test_without_time_the_blocks_alone_tell(fitted: tuple[Fitter, Fitted, Fitted]) -> None:
    fitter, true, _ = fitted
    assert separate(fitter, true, true, 0.05, clock.now() - 1.0)


@pytest.mark.parametrize("name", ["drive-delay", "sensor-delay"])
def test_a_dead_time_is_told_on_both_sides_whatever_stands_beside_it(name: str) -> None:
    limit, late = {"name": "drive-saturation", "limit": 0.5}, {"name": name, "delay": 2.5e-3}
    balance = ForceBalance(stage(), load_data([run(stage(effects=[limit, late]), there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    found = Search(base, fitter.fit([Term.of(late), Term.of(limit)], base))
    sets = alternatives(fitter, found, math.inf)
    assert set(sets[0].names) >= {"drive-delay", "sensor-delay"}
    assert not {"drive-delay", "sensor-delay"} & set(sets[1].names)
