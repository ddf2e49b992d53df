"""The oracle: what a retuning within what beliefs are wrong by takes up of a mismatch, and what it cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rtcomp.trial.draw import Case, Plan, draw
from rtcomp.trial.friction import along, stop_elements, stops_along
from rtcomp.trial.oracle import OFF, Balance, Bare, balance
from rtcomp.trial.plant import simulate


@pytest.fixture(scope="module")
def case() -> Case:
    return draw(Plan("case", "clean", (), "full", 3))


@pytest.fixture(scope="module")
def seen(case: Case) -> Balance:
    run = case.run("train")
    return balance(case.bare, case.loop, run, run.truth)


def left(seen: Balance, mismatch: np.ndarray) -> float:
    """Part of `mismatch` that no retuning takes up."""
    rest = replace(seen, residual=mismatch).retuned
    return float(np.sqrt(np.mean(rest**2) / np.mean(mismatch**2)))


def test_elements_of_another_stiffness_are_a_belief_that_is_off(seen: Balance) -> None:
    uneven = np.random.default_rng(1).uniform(-0.9, 0.9, seen.stops.shape[1]) * OFF
    assert left(seen, seen.stops @ uneven) < 1e-3


def test_elements_further_off_than_beliefs_are_stand_out(seen: Balance) -> None:
    within, beyond = np.zeros((2, seen.stops.shape[1]))
    within[::3], beyond[:6] = 0.9 * OFF, 20.0 * OFF  # contacts that yield early are three times as stiff
    assert left(seen, seen.stops @ within) < 1e-3
    assert left(seen, seen.stops @ beyond) > 0.02


def test_mass_and_damping_are_taken_up_whatever_they_are(seen: Balance) -> None:
    assert left(seen, seen.tangents @ np.array([0.5, 40.0, -300.0, 0.3, 0.0])) < 1e-6


def test_what_no_belief_has_is_not_taken_up(seen: Balance) -> None:
    time = np.arange(seen.residual.size) / 1000.0
    assert left(seen, np.sin(2 * np.pi * 13.7 * time)) > 0.8


@pytest.mark.parametrize("rate", [500.0, 1000.0])
def test_where_nothing_is_hidden_nothing_shows(case: Case, rate: float) -> None:
    loop = case.loop._replace(rate=rate)
    slow = replace(case, loop=loop)
    clean, again = slow.run("train"), simulate(case.bare, loop, slow.reference("train"), 5)
    shows = Bare.of(case.bare, loop, clean).strength(again)
    assert shows.detectability(True) < 0.3 and shows.detectability(False) < 0.3


@pytest.mark.parametrize("factor", [0.6, 1.5])
def test_another_reach_is_a_retuning_however_far(case: Case, factor: float) -> None:
    clean = case.run("train")
    run = simulate(case.bare._replace(reach=factor * case.bare.reach), case.loop, case.reference("train"), 1)
    bare = Bare.of(case.bare, case.loop, clean)
    shows = bare.strength(run)
    assert shows.detectability(True) > 10.0
    assert shows.detectability(False) < 1.0  # stiffer contacts are sampled worse
    by_tangent = balance(case.bare, case.loop, run, run.truth).retuned
    assert np.sqrt(np.mean(by_tangent**2)) > 3.0 * bare.floor


def test_stop_elements_add_up_to_the_smooth_friction() -> None:
    x = 4e-5 * np.sin(np.linspace(0.0, 40.0, 4000)) * np.linspace(1.0, 0.2, 4000)
    h = np.zeros_like(x)
    along(x, 1e-5, 3.0, h)
    elements = np.array(stop_elements(2.0, 1e-5, 3.0, 18))
    forces = stops_along(x, elements[:, 0].copy(), elements[:, 1].copy())
    assert forces.sum(axis=1) == pytest.approx(2.0 * h, abs=2.0 * 0.003)
