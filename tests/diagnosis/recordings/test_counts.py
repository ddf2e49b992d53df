"""The counts of a sensor are told by its readings, and only where these show them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.diagnosis.recordings.counts import count_of
from rtcomp.kernels import Floats


def motion(seed: int, counts: float = 300.0, rows: int = 4000) -> Floats:
    """A smooth motion with noise, of a stroke of so many counts of size 1."""
    random = np.random.default_rng(seed)
    t = np.linspace(0.0, 6.0 * np.pi, rows)
    return counts * np.sin(t + random.uniform(0.0, 6.0)) + 0.3 * random.standard_normal(rows)


@given(st.integers(0, 10_000), st.floats(1e-9, 1e-2), st.floats(-50.0, 50.0))
def test_readings_in_counts_show_them(seed: int, count: float, offset: float) -> None:
    read = count * (np.round(motion(seed)) + offset)
    assert count_of([read[:1000], read[1000:]]) == pytest.approx(count, rel=1e-3)


@given(st.integers(0, 10_000), st.floats(1e-9, 1e-2))
def test_readings_without_counts_show_none(seed: int, scale: float) -> None:
    assert count_of([scale * motion(seed)]) == 0.0


FAST = np.cumsum(np.random.default_rng(1).integers(1000, 2000, 300)) * 1e-6


@pytest.mark.parametrize("read", [np.zeros(100), np.full(100, 0.7), np.zeros(1), FAST])
def test_what_rests_or_goes_far_in_each_row_shows_none(read: Floats) -> None:
    assert count_of([read]) == 0.0


def test_counts_written_with_few_digits_and_a_bridged_gap_are_told() -> None:
    read = np.round(0.00153398 * np.round(motion(3)), 6)
    read[500:520] = np.linspace(read[500], read[520], 20)
    assert count_of([read]) == pytest.approx(0.00153398, rel=2e-3)
