"""Percentiles, missed slots and joined stretches, against counting them one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.bench.spread import Spread, ratio

times = st.lists(st.floats(0.0, 1e6, allow_nan=False), min_size=1, max_size=60)


@given(times, st.floats(0.01, 100.0))
def test_a_percentile_is_the_least_time_that_so_many_do_not_exceed(values, percent):
    found = Spread.of(values).percentile(percent)
    within = [v for v in values if v <= found]
    below = [v for v in values if v < found]
    need = percent / 100.0 * len(values) - 1e-6
    assert found in values and len(within) >= need and len(below) < need + 2e-6 + 1e-9 * len(values)


@given(times)
def test_the_hundredth_percentile_is_the_longest(values):
    spread = Spread.of(values)
    assert spread.percentile(100.0) == spread.longest == max(values)
    assert spread.total == len(values)


@given(times, times)
def test_stretches_join_as_if_they_had_been_one(first, second):
    joined, whole = Spread.joined([Spread.of(first), Spread.of(second)]), Spread.of(first + second)
    assert np.array_equal(joined.values, whole.values) and np.array_equal(joined.counts, whole.counts)


@given(st.lists(st.integers(0, 3000), min_size=1, max_size=60))
def test_a_histogram_is_the_same_as_its_times(values):
    spread = Spread.counted({float(v): values.count(v) for v in range(3001)})
    assert spread.figures() == Spread.of(values).figures()


@given(st.lists(st.tuples(st.integers(0, 20), st.floats(0.0, 0.99)), min_size=1, max_size=40))
def test_missed_slots_are_the_whole_periods_of_each_lateness(late):
    period = 125.0
    spread = Spread.of([period * (slots + part) for slots, part in late])
    assert spread.missed(period) == sum(slots for slots, _ in late)


def test_a_known_spread():
    spread = Spread.of([*range(1, 1001)])
    assert spread.figures() == {"p50_us": 500.0, "p99_us": 990.0, "p999_us": 999.0, "max_us": 1000.0}
    assert spread.missed(400.0) == 400 + 2 * 201  # 400 to 799 cost one slot, 800 to 1000 two


def test_nothing_has_no_percentiles_and_misses_nothing():
    for empty in (Spread.of([]), Spread.joined([]), Spread.counted({5.0: 0})):
        assert empty.total == 0 and empty.missed(100.0) == 0
        assert all(math.isnan(value) for value in empty.figures().values())


def test_a_ratio_to_nothing_is_none():
    assert ratio(3.0, 2.0) == pytest.approx(1.5) and ratio(3.0, 0.0) is None and ratio(0.0, 2.0) == 0.0
