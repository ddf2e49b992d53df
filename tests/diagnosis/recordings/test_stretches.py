"""Recordings with holes: long ones part it, short ones are bridged, and neither is taken for physics."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import RATE, changed, run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.recordings.stretches import BRIDGED, LEAST_ROWS, MOST, stretches
from rtcomp.recording.reader import Recording


@given(st.lists(st.tuples(st.integers(1, 900), st.integers(1, 40)), min_size=1, max_size=30), st.booleans())
def test_stretches_hold_no_long_gap_and_are_as_long_as_can_be(
    runs: list[tuple[int, int]], good_first: bool
) -> None:
    trusted = np.concatenate([np.repeat([good_first, not good_first], run) for run in runs])
    found = stretches(trusted)
    assert len(found) <= MOST
    for rows in found:
        assert rows.stop - rows.start >= LEAST_ROWS
        assert trusted[rows.start] or rows.start == 0
        bad = (~trusted[rows]).astype(int)
        assert np.convolve(bad, np.ones(BRIDGED + 1)).max() <= BRIDGED
    assert all(a.stop + BRIDGED < b.start for a, b in pairwise(found))


@pytest.fixture(scope="module")
def good() -> Recording:
    return run(stage(), there_and_back(12.0))


def spoilt(recording: Recording, *gaps: slice) -> Recording:
    """The recording with nothing measured in `gaps`: a straight line stands there."""
    rows = np.arange(len(recording))
    gap = np.zeros(rows.size)
    for rows_of in gaps:
        gap[rows_of] = 1.0
    trusted = gap == 0
    columns = {
        k: np.interp(rows, rows[trusted], recording.columns[k][trusted]) for k in ("position", "voltage")
    }
    return changed(recording, gap=gap, **columns)


def left(recording: Recording) -> float:
    balance = ForceBalance(stage(), load_data([recording]))
    return float(np.sqrt(baseline(balance).sse / balance.power))


def test_a_hole_leaves_the_balance_closed(good: Recording) -> None:
    holes = spoilt(good, slice(3000, 3400), slice(7000, 7150), slice(9000, 9003))
    assert len(load_data([holes]).segments) == 3
    assert left(holes) < 1.5 * left(good)


def test_what_comes_after_a_hole_keeps_its_time(good: Recording) -> None:
    first, second = load_data([spoilt(good, slice(3000, 3400))]).segments
    assert (first.time[0], second.time[0]) == (0.0, pytest.approx(3.4))
    assert second.time.size == len(good) - 3400 and RATE == 1000.0


def test_doubtful_rows_everywhere_leave_one_stretch(good: Recording) -> None:
    every = changed(good, gap=(np.arange(len(good)) % 40 < 10).astype(float))
    assert len(load_data([every]).segments) == 1
