"""A model is confirmed by the objective that it was not fitted to: by positions, or by forces."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pendulum import LOAD, balanced, both
from pendulum import stage as pendulum
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.numerics.robust import shows
from rtcomp.diagnosis.positions.trajectory import Trajectory
from rtcomp.diagnosis.positions.windows import Windows
from rtcomp.diagnosis.search.confirmed import denied, errors, there

COGGING = {"name": "cogging", "amplitude": 0.4, "period": 1.3e-4, "phase": 0.4}


@given(st.floats(-1.0, 2.0), st.floats(1e-6, 1e6), st.integers(0, 1000))
def test_the_part_that_is_there_shows(part: float, unit: float, seed: int) -> None:
    """Errors without an effect are the part of it that is there; with it, that less all of it."""
    done = unit * np.random.default_rng(seed).standard_normal((12, 40))
    found, error = shows([part * d - d for d in done], [part * d for d in done])
    assert found == pytest.approx(part) and error < 1e-6


@given(st.floats(0.0, 1.0), st.integers(0, 1000))
def test_errors_much_larger_than_an_effect_leave_the_part_open(part: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    done = random.standard_normal((40, 20))
    rest = 30.0 * random.standard_normal((40, 20)) + part * done
    found, error = shows(list(rest - done), list(rest))
    assert error > 0.3 and abs(found - part) < 6.0 * error


@given(st.integers(0, 1000))
def test_a_window_that_went_far_off_says_no_more_than_others(seed: int) -> None:
    random = np.random.default_rng(seed)
    done = random.standard_normal((12, 40))
    rest = 0.1 * random.standard_normal((12, 40))
    rest[3] *= 1e4
    found, error = shows(list(rest), list(done + rest))
    assert found == pytest.approx(1.0, abs=0.2) and error < 0.2


@pytest.mark.parametrize(("part", "rest", "whether"), [(1.0, 3.0, True), (0.0, 3.0, False), (0.4, 0.1, False),
                                                       (2.0, 0.1, False), (1.0, 300.0, False)])  # fmt: skip
def test_an_effect_is_there_by_what_shows_of_it(part: float, rest: float, whether: bool) -> None:
    """Not where less than half or twice as much shows, nor where it may be nothing; else it is."""
    random = np.random.default_rng(5)
    done = random.standard_normal((40, 20))
    others = rest * random.standard_normal((40, 20)) + part * done
    assert there(list(others - done), list(others)) == whether


def test_what_does_nothing_shows_nothing() -> None:
    still = [np.ones(5), np.zeros(5)]
    assert shows(still, still) == (0.0, np.inf)


def test_simulated_positions_confirm_what_forces_found() -> None:
    recording = run(stage(effects=[COGGING]), there_and_back(8.0))
    fitter = Fitter(balanced(stage(), [recording]))
    right, wrong = (
        fitter.fit([term], steps=0)
        for term in (Term.of(COGGING), Term({"name": "drive-delay", "delay": 4e-3}, frozenset()))
    )
    without = fitter.fit([])
    windows = Windows.of(fitter.balance)
    found, _ = shows(*(errors(fitter, m, windows) for m in (right, without)))
    assert found == pytest.approx(1.0, abs=0.05)
    assert not denied(fitter, right, without)
    assert denied(fitter, wrong, without)


def test_forces_confirm_what_positions_found() -> None:
    fitter = Trajectory.of(balanced(pendulum(), both(pendulum(LOAD))), pendulum())
    without = fitter.fit([])
    found = fitter.fit([Term(LOAD, frozenset({"coefficient"}))], without)
    part, _ = shows(*(errors(fitter, m, None) for m in (found, without)))
    assert part > 0.8
    assert not denied(fitter, found, without)


@pytest.mark.parametrize("gap", [5e-7, 5e-6])
def test_a_play_that_is_there_is_not_denied(gap: float) -> None:
    """Noise of the reading kicks its load: where replicates go another way, there is nothing to compare."""
    play = {"name": "backlash", "gap": gap, "share": 0.5, "contact": 150.0}
    recording = run(stage(effects=[play]), there_and_back(8.0))
    fitter = Fitter(balanced(stage(), [recording]))
    right, without = fitter.fit([Term(play, frozenset())], steps=0), fitter.fit([])
    assert not denied(fitter, right, without)
