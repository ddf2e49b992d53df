"""How certain numbers are said to be: by blocks left out, by happening once, by being chosen to be told."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import run, there_and_back
from recorded import stage as axis
from scipy.signal import lfilter

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.intervals import numbers as numbers_of
from rtcomp.diagnosis.fitting.retuned import retunings, widening
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.spread import elsewhere, scatter
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.recordings.data import load_data


def test_blocks_left_out_tell_how_uncertain_a_mean_is() -> None:
    chance = np.random.default_rng(5)
    found = []
    for _ in range(400):
        blocks = chance.standard_normal((20, 2)) * [1.0, 3.0]
        found.append(scatter((blocks.sum(axis=0) - blocks) / 19.0))
    mean = np.mean(found, axis=0)
    assert np.diag(mean) == pytest.approx([1.0 / 20.0, 9.0 / 20.0], rel=0.15)
    assert abs(mean[0, 1]) < 0.01


def test_blocks_like_their_neighbours_count_as_fewer() -> None:
    chance = np.random.default_rng(6)
    plain, alike = [], []
    for _ in range(200):
        walk = chance.standard_normal((21, 1))
        plain.append(scatter(walk[1:])[0, 0])
        alike.append(scatter((walk[1:] + walk[:-1]) / np.sqrt(2.0))[0, 0])
    assert np.mean(alike) > 1.2 * np.mean(plain)


@pytest.mark.parametrize("alike", [0.0, 0.8])
def test_what_happened_once_is_as_uncertain_as_what_noise_makes_of_it_elsewhere(alike: float) -> None:
    """As wide as least squares scatters over many noises, white or alike for a few rows."""
    chance = np.random.default_rng(7)
    column = np.zeros(4000)
    column[1500:1540] = np.sin(np.arange(40) / 5.0)
    told, found = [], []
    for _ in range(200):
        noise = lfilter([1.0], [1.0, -alike], chance.standard_normal(column.size))
        told.append(elsewhere(column, noise))
        found.append(column @ noise / (column @ column))
    assert np.mean(told) == pytest.approx(np.var(found), rel=0.25)
    if alike == 0.0:
        assert np.mean(told) == pytest.approx(1.0 / (column @ column), rel=0.05)


def test_numbers_told_because_they_moved_have_wider_intervals() -> None:
    """As Benjamini and Yekutieli have it: all chosen, plain intervals; one of many, much wider ones."""
    assert widening(np.full(5, 9.0), 5) == pytest.approx(1.0, rel=1e-3)
    one, two = widening(np.array([9.0, 0, 0, 0, 0]), 5), widening(np.array([9.0, 9.0, 0, 0, 0]), 5)
    assert 1.1 < two < one < 1.6
    assert widening(np.array([1.1, 0, 0, 0, 0]), 5) == np.inf  # too little to be told


def test_a_mass_that_is_another_is_told_with_an_interval_that_holds_it() -> None:
    true, believed = axis(mass=2.0 * 1.09), axis()
    balance = ForceBalance(believed, load_data([run(true, there_and_back(8.0))]))
    (told,) = retunings(numbers_of(Fitter(balance), believed, baseline(balance)), "linear")
    assert told.parameter == "mass"
    assert told.after.low <= true.mass <= told.after.high


def test_a_force_constant_that_is_another_is_told_as_such_and_moves_alike() -> None:
    true, believed = axis(force_constant=4.0 / 1.08), axis()
    motion = run(true, there_and_back(8.0))
    done = diagnose(believed, [motion], budget=300.0)
    assert done.verdict == "retuned"
    (told,) = done.retuned
    assert told.parameter == "force_constant"
    assert told.after.low <= true.force_constant <= told.after.high
    assert done.stage.force_constant == pytest.approx(true.force_constant, rel=0.02)
    assert done.stage.mass == pytest.approx(believed.mass, rel=0.03)
    assert done.fit.after < 0.2 * done.fit.before


def test_the_size_of_a_believed_effect_that_is_another_is_told() -> None:
    cogging = {"name": "cogging", "amplitude": 0.5, "period": 1e-4, "phase": 0.4}
    believed = axis(effects=[{**cogging, "amplitude": 0.4}])
    done = diagnose(believed, [run(axis(effects=[cogging]), there_and_back(8.0))], budget=300.0)
    assert done.verdict == "retuned"
    (told,) = [r for r in done.retuned if r.parameter == "cogging.amplitude"]
    assert told.before == 0.4 and told.after.low <= 0.5 <= told.after.high
    assert told.after.unit == "N"
