"""Cutting a motion at its reversals: noise is none, minor loops are passed over."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loops import cut, major_and_minor, operator, walk

from rtcomp.inspection.branches import turning_points

PATHS = st.lists(st.integers(-50, 50).map(float), min_size=2, max_size=30)


@given(path=PATHS, least=st.floats(0.0, 30.0))
def test_turning_points_take_turns_and_lie_further_apart_than_the_least(
    path: list[float], least: float
) -> None:
    x = walk(path)
    rows = turning_points(x, least)
    at = x[rows]
    assert np.all(np.abs(np.diff(at)) > least)
    assert np.all(np.diff(np.sign(np.diff(at))) != 0)
    # Between two of them no row lies beyond either.
    for first, last in pairwise(rows):
        low, high = sorted((x[first], x[last]))
        assert x[first : last + 1].min() == low and x[first : last + 1].max() == high


@given(path=PATHS, noise=st.integers(0, 2**31))
def test_motion_within_the_least_makes_no_turning_point(path: list[float], noise: int) -> None:
    x = walk(path)
    off = np.random.default_rng(noise).uniform(-0.4, 0.4, x.size)
    clean, noisy = turning_points(x, 5.0), turning_points(x + off, 5.9)
    # What is a reversal of more than 6.8 in the clean motion is one in the noisy motion, and no more are.
    assert turning_points(x, 6.8).size <= noisy.size <= clean.size


def test_a_turning_point_is_the_first_row_of_a_rest() -> None:
    x = np.array([0.0, 1, 2, 3, 3, 3, 3, 2, 1, 0, 0, 1, 2])
    assert list(turning_points(x, 0.5)) == [3, 9]


def test_a_motion_in_one_direction_has_no_branches() -> None:
    x = np.arange(100.0)
    assert cut(x, x) == [] and cut(x[::-1], x) == []


def test_a_branch_is_mirrored_and_begins_at_its_turning_point() -> None:
    x = walk([10.0, -10.0, 10.0, -10.0])
    down, up, last = cut(x, 2.0 * x, least=1.0)
    assert (down.rising, up.rising, last.rising) == (False, True, False)
    for one, start in ((down, 10.0), (up, -10.0)):
        assert (one.position, one.force, one.length, one.end) == (start, 2.0 * start, 20.0, -start)
        assert np.array_equal(one.gained, 2.0 * one.travel)
        assert np.array_equal(one.forces(), 2.0 * (start + one.sign * one.travel))
        assert one.whole and one.speed == 1.0
    assert not last.whole
    assert down.free == 10.0  # it goes back over ten; what was before that is not known
    assert up.free == 20.0


def test_a_stop_at_a_reversal_is_left_out() -> None:
    x = np.concatenate([walk([10.0, -10.0]), np.full(40, -10.0), walk([20.0])[1:] - 10.0, [9.0, 8.0, 7.0]])
    force = x.copy()
    force[30:70] += np.linspace(0.0, 5.0, 40)  # it creeps while it rests
    force[70:] += 5.0
    up = cut(x, force, least=1.0)[1]
    assert up.rising and up.rows[0] == 70
    assert np.allclose(up.gained, up.travel)


def test_small_motions_back_do_not_count() -> None:
    x = major_and_minor()
    large = cut(x, operator().response(x), least=60.0)
    assert all(b.length == 120.0 for b in large[1:])
    first = large[1]
    assert np.all(np.diff(first.travel) > 0)
    # Wiping-out: over its minor loops the branch is the one without them.
    bare = walk([60.0, -60.0, 60.0, -60.0])
    plain = cut(bare, operator().response(bare), least=60.0)[1]
    assert np.allclose(first.at(plain.travel), plain.gained, atol=1e-12)


@pytest.mark.parametrize("least", [0.0, 5.0, 60.0])
def test_rows_of_the_branches_follow_each_other(least: float) -> None:
    x = major_and_minor()
    found = cut(x, x, least)
    assert all(a.rows[1] == b.rows[0] for a, b in pairwise(found))
