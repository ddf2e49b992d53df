"""Friction that yields later than the grid goes, and speeds that no motion shows."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline, yielding_later
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import FASTEST, Term, free_of
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.reaches import LONGEST
from rtcomp.diagnosis.recordings.data import load_data

SHORT = [{"stiffness": 2e5, "reach": 4e-6}]
SPRING = {"name": "parallel-spring", "stiffness": 4e3}


def fitted(**true: object) -> tuple[Fitter, Fitted]:
    """A belief without friction, refitted to a recording of a stage."""
    balance = ForceBalance(stage(friction=[]), load_data([run(stage(**true), there_and_back(16.0))]))
    return Fitter(balance), baseline(balance)


def test_friction_beyond_the_grid_is_found_where_a_fit_has_some_at_its_end() -> None:
    stroke = 7e-4
    fitter, base = fitted(friction=[*SHORT, {"stiffness": 8e3, "reach": 1.6 * LONGEST * stroke}])
    later = yielding_later(fitter, base)
    assert later is not None
    assert later.fit([]).errors.sum() < 0.3 * base.errors.sum()


def test_friction_that_ends_before_the_grid_does_is_left_as_it_is() -> None:
    fitter, base = fitted(friction=SHORT)
    assert yielding_later(fitter, base) is None


def test_a_spring_explains_more_than_friction_that_yields_late() -> None:
    fitter, base = fitted(friction=SHORT, effects=[SPRING])
    later, spring = yielding_later(fitter, base), fitter.fit([Term.of(SPRING)])
    assert later is None or spring.errors.sum() < 0.3 * later.fit([]).errors.sum()


def test_no_speed_is_looked_for_that_is_a_constant_on_this_motion() -> None:
    """A level that falls at a speed nobody goes is a friction of another level."""
    fitter, _ = fitted(friction=SHORT)
    entry = {"name": "stribeck", "rise": 0.1, "velocity": 1e-3}
    (speed,) = [f for f in free_of([Term.of(entry)], fitter.balance) if f.name == "velocity"]
    fastest = max(np.abs(p.v).max() for p in fitter.balance.paths())
    assert speed.high == pytest.approx(FASTEST * fastest)
    assert speed.at_bound([Term.of({**entry, "velocity": speed.high})])
