"""Fewer points that look the same."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rtcomp.report.decimate import path_indices, peak_indices

COLUMN = arrays(np.float64, st.integers(1, 3000), elements=st.floats(-1e6, 1e6) | st.just(np.nan))


@given(COLUMN, st.integers(5, 200))
@settings(max_examples=60, deadline=None)
def test_peaks_order_ends_and_gaps_stay(column: np.ndarray, points: int) -> None:
    kept = peak_indices([column], points)
    assert len(kept) <= max(points, 0) or len(column) <= points
    assert kept[0] == 0 and kept[-1] == len(column) - 1
    assert np.all(np.diff(kept) > 0)
    drawn = column[kept]
    assert np.isnan(drawn).any() == np.isnan(column).any()
    if np.isfinite(column).any():
        assert np.nanmax(drawn) == np.nanmax(column)
        assert np.nanmin(drawn) == np.nanmin(column)


@given(st.integers(0, 19_999), st.floats(1.0, 1e3), st.sampled_from([-1.0, 1.0]))
@settings(max_examples=40, deadline=None)
def test_a_single_outlier_anywhere_is_drawn(where: int, size: float, sign: float) -> None:
    column = np.sin(np.arange(20_000) / 300.0)
    column[where] = sign * (1.0 + size)
    assert where in peak_indices([column, np.zeros(20_000)], 600)


def test_the_envelope_is_kept_everywhere_not_only_at_the_top() -> None:
    rng = np.random.default_rng(3)
    column = rng.standard_normal(100_000) * np.linspace(1.0, 20.0, 100_000)
    kept = peak_indices([column], 3000)
    assert len(kept) <= 3000
    for low in range(0, 100_000, 5_000):
        mine = column[kept[(kept >= low) & (kept < low + 5_000)]]
        assert (
            mine.max() == column[low : low + 5_000].max()
            or mine.max() > 0.9 * column[low : low + 5_000].max()
        )
        assert mine.min() < 0.9 * column[low : low + 5_000].min()


def test_every_column_keeps_its_own_peaks() -> None:
    one, two = np.zeros(10_000), np.zeros(10_000)
    one[1234], two[1235] = 1.0, -1.0
    assert {1234, 1235} <= set(peak_indices([one, two], 500).tolist())


def test_few_rows_are_left_alone() -> None:
    assert peak_indices([np.arange(7.0)], 10).tolist() == list(range(7))
    assert peak_indices([np.empty(0)], 10).size == 0
    assert path_indices([np.empty(0), np.empty(0)], 10).size == 0


@pytest.mark.parametrize("points", [-1, 0, 3, 4])
def test_too_few_points_are_refused(points: int) -> None:
    with pytest.raises(ValueError, match="too few"):
        peak_indices([np.zeros(100)], points)


def test_columns_of_different_length_are_refused() -> None:
    with pytest.raises(ValueError, match="same length"):
        peak_indices([np.zeros(100), np.zeros(99)], 50)


def loops(cycles: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """A slow and a fast half in each cycle, so that rows say nothing of the way along the loop."""
    phase = 2 * np.pi * np.arange(cycles * samples) / samples
    phase = phase + 0.9 * np.sin(phase)
    return np.cos(phase), np.sin(phase) * np.abs(np.sin(phase))


def test_a_path_keeps_its_shape_and_reversals() -> None:
    x, y = loops(3, 40_000)
    kept = path_indices([x, y], 4000)
    assert len(kept) <= 4000
    assert kept[0] == 0 and kept[-1] == len(x) - 1
    # Every sample lies near the drawn polyline: nearest drawn vertex within a hundredth of the range.
    for i in range(0, len(x), 997):
        assert np.hypot(x[kept] - x[i], y[kept] - y[i]).min() < 0.02
    assert x[kept].max() == x.max() and x[kept].min() == x.min()


def test_a_path_too_long_to_draw_shows_its_last_stretch_faithfully() -> None:
    x, y = loops(500, 400)
    kept = path_indices([x, y], 2000)
    assert len(kept) <= 2000
    assert kept[0] > 0 and kept[-1] == len(x) - 1
    assert np.hypot(np.diff(x[kept]), np.diff(y[kept])).max() < 0.15


@given(COLUMN, st.integers(7, 300))
@settings(max_examples=50, deadline=None)
def test_a_path_is_bounded_and_in_order_whatever_it_is(column: np.ndarray, points: int) -> None:
    kept = path_indices([column, column[::-1]], points)
    assert len(kept) <= max(points, 1)
    assert np.all(np.diff(kept) > 0)
    assert kept[-1] == len(column) - 1
