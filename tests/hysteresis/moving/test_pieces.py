"""Straight pieces over a branch, against closed forms, and the slopes that the branch is made of."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.moving import places as at
from rtcomp.hysteresis.moving.branch_slopes import slopes
from rtcomp.hysteresis.moving.pieces import best_split, of_noise, piece
from rtcomp.hysteresis.moving.self_placing import SelfPlacingBasis

CELLS = 40


def branch(values, count=4):
    """Parameters and memory of equal cells over 1 m with these values (N) of the branch at their corners."""
    p = np.concatenate([[count, CELLS], np.linspace(0, CELLS, count + 1), np.linspace(0.0, 1.0, CELLS + 1)])
    m = np.zeros(at.ARRAYS + 4 * CELLS + 2 + 6 * count)
    m[at.DEEPEST] = CELLS
    m[at.ARRAYS + 2 * CELLS : at.ARRAYS + 3 * CELLS + 1] = values
    return p, m


WAY = np.linspace(0.0, 1.0, CELLS + 1)


@settings(max_examples=50, deadline=None)
@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.integers(0, 20), st.integers(4, 20))
def test_a_straight_branch_costs_nothing(slope, height, low, length):
    p, m = branch(height + slope * WAY)
    assert piece(p, m, low, low + length) == pytest.approx(0.0, abs=1e-12)


def test_a_parabola_costs_what_the_integral_says():
    """The least square error of a line over x^2 on an interval of length h is h^5 / 180."""
    p, m = branch(WAY**2)
    assert piece(p, m, 0, CELLS) == pytest.approx(1.0 / 180.0, rel=0.02)
    assert piece(p, m, 10, 30) == pytest.approx(0.5**5 / 180.0, rel=0.05)


@pytest.mark.parametrize("kink", [8, 17, 30])
def test_a_kink_is_where_the_pieces_meet(kink):
    p, m = branch(np.minimum(WAY, WAY[kink]) * 3.0 + 0.2 * WAY)
    least, at_corner = best_split(p, m, 0, CELLS)
    assert at_corner == kink and least == pytest.approx(0.0, abs=1e-12)
    assert piece(p, m, 0, CELLS) > 1e-3


def test_no_part_is_narrower_than_the_gate_allows():
    p, m = branch(np.minimum(WAY, WAY[2]))
    assert best_split(p, m, 0, CELLS)[1] == 2
    m[at.GATE] = 0.1
    assert best_split(p, m, 0, CELLS)[1] >= 8
    m[at.GATE] = 1.0
    assert best_split(p, m, 0, CELLS) == (np.inf, 0)


def test_noise_of_a_corner_is_the_mean_over_the_cells():
    p, m = branch(WAY)
    m[at.ARRAYS + 3 * CELLS + 1 : at.ARRAYS + 4 * CELLS + 2] = 0.02 * np.arange(CELLS + 1)
    assert of_noise(p, m, 5, 25) == pytest.approx(0.02 / CELLS)
    assert of_noise(p, m, 5, 5) == 0.0


def test_without_noise_the_slopes_are_the_branch_s():
    fine, weights = IntervalBasis.over(200, 1.0), np.linspace(4.0, 0.5, 200)
    time = np.arange(20_000) / 500.0
    u = 0.55 * (0.2 + 0.8 * np.abs(np.sin(0.9 * time))) * np.sin(2 * np.pi * time)
    force = regressors(fine, u) @ weights
    basis = SelfPlacingBasis.over(5, 1.0)
    p, s, x, m = basis.vector(), basis.initial_state(), np.zeros(5), basis.memory(0.002)
    for value, f in zip(u, force, strict=True):
        basis.kernel(p, s, x, value)
        slopes(p, s, m, f)
        m[at.FORCE], m[at.PEAK] = f, max(m[at.PEAK], abs(f))
    cells = int(p[at.CELLS])
    corners = p[at.EDGES + 6 :]
    middle = 0.5 * (corners[1:] + corners[:-1])
    wide = np.diff(corners) > 0.002
    true = np.interp(middle, fine.widths.cumsum() - 0.0025, weights)
    found = m[at.ARRAYS : at.ARRAYS + cells]
    assert np.abs(found - true)[wide].max() < 0.15
    assert np.sum(found * np.diff(corners)) == pytest.approx(weights.mean(), rel=1e-3)
