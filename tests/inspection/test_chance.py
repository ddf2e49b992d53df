"""Curves compared with their own repeats, and slopes with confidence: errors as often as promised."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.inspection.chance import SURE, Compared, compare, distances, slope


def of(curves: np.ndarray, kinds: list[int]) -> Compared:
    whole = np.full(len(curves), curves.shape[1])
    return compare(distances(curves, whole), np.array(kinds), np.zeros(len(curves), dtype=int))


def test_distances_are_mean_squares_over_what_both_have() -> None:
    curves = np.array([[0.0, 0, 0, 0], [1, 1, 9, 9], [2, 4, 6, 8]])
    square = distances(curves, np.array([4, 2, 4]))
    assert square[0, 1] == square[1, 0] == 1.0
    assert square[0, 2] == pytest.approx((4 + 16 + 36 + 64) / 4)
    assert square[1, 2] == pytest.approx((1 + 9) / 2)
    assert np.all(np.diag(square) == 0.0)


@given(
    kinds=st.lists(st.integers(0, 3), min_size=4, max_size=9).filter(lambda k: 1 < len(set(k)) < len(k)),
    seed=st.integers(0, 2**31),
)
def test_the_means_are_those_of_the_definition(kinds: list[int], seed: int) -> None:
    curves = np.random.default_rng(seed).standard_normal((len(kinds), 7))
    found = of(curves, kinds)
    ms = ((curves[:, None] - curves[None]) ** 2).mean(axis=2)
    k = np.array(kinds)
    between = [ms[np.ix_(k == a, k == b)].mean() for a in set(kinds) for b in set(kinds) if a < b]
    inside = [ms[i, j] for i in range(len(k)) for j in range(len(k)) if i != j and k[i] == k[j]]
    assert found.between == pytest.approx(math.sqrt(np.mean(between)))
    assert found.within == pytest.approx(math.sqrt(np.mean(inside)))
    assert 0.0 < found.p_value <= 1.0


def test_p_values_of_alike_curves_are_even() -> None:
    chance = np.random.default_rng(4)
    p = np.array([of(chance.standard_normal((10, 20)), [0] * 5 + [1] * 5).p_value for _ in range(300)])
    assert np.mean(p <= 0.05) < 0.11 and np.mean(p <= 0.5) == pytest.approx(0.5, abs=0.12)


def test_an_exact_test_counts_every_assignment_once() -> None:
    curves = np.concatenate([np.zeros((4, 5)), np.ones((4, 5))]) + 0.01 * np.random.default_rng(
        5
    ).standard_normal((8, 5))
    found = of(curves, [0] * 4 + [1] * 4)
    assert found.p_value == pytest.approx(2 / math.comb(8, 4)) == pytest.approx(found.smallest_p)


def test_too_few_repeats_need_a_clear_difference() -> None:
    chance = np.random.default_rng(6)
    small = np.concatenate([np.zeros((2, 9)), np.full((2, 9), 0.1)]) + 0.05 * chance.standard_normal((4, 9))
    found = of(small, [0, 0, 1, 1])
    assert found.smallest_p > SURE and found.verdict(1.0) == "undecided"
    assert of(small + np.array([[0.0], [0.0], [1.0], [1.0]]), [0, 0, 1, 1]).verdict(1.0) == "fails"


def test_without_repeats_or_without_kinds_nothing_is_decided() -> None:
    assert of(np.eye(3), [0, 1, 2]).verdict(1.0) == "undecided"
    assert of(np.eye(3), [0, 0, 0]).verdict(1.0) == "not-testable"


def test_differences_nobody_models_are_none() -> None:
    curves = np.repeat([[0.0], [1e-3]], 6, axis=0) * np.ones((12, 5))
    found = of(curves, [0] * 6 + [1] * 6)
    assert found.p_value < SURE and found.verdict(1.0) == "holds" and found.verdict(0.01) == "fails"


def test_a_slope_lies_within_its_interval_as_often_as_promised() -> None:
    chance = np.random.default_rng(7)
    inside = 0
    for _ in range(200):
        x = chance.uniform(-1, 1, 8)
        block = np.repeat([0, 1], 4)
        found = slope(x, 3.0 * x + np.array([5.0, -2.0])[block] + 0.5 * chance.standard_normal(8), block)
        assert found is not None
        inside += found.low <= 3.0 <= found.high
    assert inside >= 180


def test_a_slope_of_too_few_points_or_of_one_place_is_none() -> None:
    block = np.zeros(3, dtype=int)
    assert slope(np.arange(3.0), np.arange(3.0), block) is None
    assert slope(np.ones(8), np.arange(8.0), np.zeros(8, dtype=int)) is None
