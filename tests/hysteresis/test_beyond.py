"""Weights beyond the reach go on as the known ones fall."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.beyond import LEAST_PASSES, continued, passes
from rtcomp.hysteresis.interval import IntervalBasis

WIDTHS = IntervalBasis.over(10, 1.0, 4.0).widths
MIDDLE = np.cumsum(WIDTHS) / 2 - WIDTHS / 4
FALLING = 5.0 * np.exp(-MIDDLE / 0.1)


def test_an_exponential_virgin_curve_goes_on_exactly():
    passed = np.where(np.arange(10) < 5, 20.0, 0.0)
    found, guessed = continued(np.where(passed > 0, FALLING, 0.0), WIDTHS, passed)
    assert np.allclose(found, FALLING, rtol=1e-9)
    assert guessed.tolist() == [False] * 5 + [True] * 5


def test_what_a_drift_touched_once_is_not_known():
    passed = np.array([20.0] * 5 + [LEAST_PASSES - 1] + [0.0] * 4)
    weights = np.where(np.arange(10) < 5, FALLING, -1.0)
    assert np.allclose(continued(weights, WIDTHS, passed)[0], FALLING, rtol=1e-9)


def test_weights_never_rise_beyond_the_reach():
    passed = np.where(np.arange(10) < 5, 20.0, 0.0)
    found = continued(np.where(passed > 0, 1.0 + MIDDLE, 0.0), WIDTHS, passed)[0]
    assert np.allclose(found[5:], found[4])


@pytest.mark.parametrize("passed", [np.zeros(10), np.full(10, 50.0)])
def test_nothing_changes_where_nothing_or_everything_is_known(passed):
    found, guessed = continued(FALLING, WIDTHS, passed)
    assert np.array_equal(found, FALLING) and not guessed.any()


def test_nothing_goes_on_from_a_weight_that_says_everything_slides():
    weights, passed = np.array([2.0, 1.0, 0.0, 0.0]), np.array([9.0, 9.0, 9.0, 0.0])
    assert np.array_equal(continued(weights, np.ones(4), passed)[0], weights)


def test_passes_count_loops():
    basis = IntervalBasis([0.2, 0.2, 0.2])
    u = 0.2 * np.sin(np.linspace(0, 2 * np.pi * 6, 6000))  # fills 0.4 of 0.6: two intervals
    counted = passes(regressors(basis, u), basis.widths)
    assert np.allclose(counted[:2], 6.0, atol=0.6) and counted[2] < 0.6
