"""The bounded least squares of the ledger, against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from rtcomp.diagnosis.blocks import Blocks, Bounds


def made(
    seed: int, columns: int = 6, rows: int = 240, blocks: int = 6
) -> tuple[np.ndarray, np.ndarray, Blocks]:
    random = np.random.default_rng(seed)
    a = random.normal(size=(rows, columns)) @ random.normal(size=(columns, columns))
    y = a @ random.normal(size=columns) + 0.3 * random.normal(size=rows)
    return a, y, Blocks.of(a, y, np.arange(rows) * blocks // rows, blocks)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_bounded_fit_is_the_best_within_the_bounds(seed: int) -> None:
    a, y, blocks = made(seed)
    random = np.random.default_rng(seed + 1)
    low = random.normal(size=6) - 1.0
    bounds = Bounds(low, low + random.uniform(0.1, 2.0, 6))
    ours = blocks.coefficients(np.ones(6, dtype=bool), bounds)
    best = lsq_linear(a, y, bounds=(bounds.low, bounds.high), tol=1e-14).x
    assert np.all(ours >= bounds.low - 1e-9) and np.all(ours <= bounds.high + 1e-9)
    assert np.sum((y - a @ ours) ** 2) <= np.sum((y - a @ best) ** 2) * (1 + 1e-6)


def test_left_out_blocks_are_predicted_by_the_others() -> None:
    a, y, blocks = made(3)
    errors = blocks.left_out(np.ones(6, dtype=bool))
    number = np.arange(240) * 6 // 240
    for k in range(6):
        c = np.linalg.lstsq(a[number != k], y[number != k], rcond=None)[0]
        expected = np.sum((y[number == k] - a[number == k] @ c) ** 2)
        assert errors[k] == pytest.approx(expected, rel=1e-5)


def test_further_columns_are_added_as_if_they_had_been_there() -> None:
    a, y, _ = made(8)
    block = np.arange(240) * 6 // 240
    few = Blocks.of(a[:, :4], y, block, 6)
    more = few.extended(a[:, :4], a[:, 4:], y, block)
    whole = Blocks.of(a, y, block, 6)
    use = np.ones(6, dtype=bool)
    assert more.coefficients(use) == pytest.approx(whole.coefficients(use), rel=1e-9)
    assert more.left_out(use) == pytest.approx(whole.left_out(use), rel=1e-9)


def test_the_part_that_no_other_column_has_is_left_of_one() -> None:
    a, _, blocks = made(11)
    for k in range(6):
        rest = np.delete(a, k, axis=1)
        expected = a[:, k] - rest @ np.linalg.lstsq(rest, a[:, k], rcond=None)[0]
        assert blocks.own_part(a, k) == pytest.approx(expected, abs=1e-5 * np.linalg.norm(a[:, k]))
