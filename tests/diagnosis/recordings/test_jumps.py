"""Jumps of the sensor: found to the row, also where the controller answers them at once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.diagnosis.recordings.data import MOST_ROWS, RUN_IN, WINDOWS, load_data, with_rows
from rtcomp.diagnosis.recordings.jumps import jumps
from rtcomp.recording.outliers import answers, outliers
from rtcomp.recording.pieces import PIECE
from rtcomp.recording.reader import Recording
from rtcomp.stage.lowpass import zero_phase


def moved(seed: int = 0, rows: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    time = np.arange(rows) / 1000.0
    return time, 2e-4 * np.sin(2.0 * time) + 1e-8 * random.standard_normal(rows)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.integers(20, 3980), st.sampled_from([-1.0, 1.0]))
def test_a_jump_is_found_to_the_row(seed: int, row: int, sign: float) -> None:
    time, x = moved(seed)
    x[row:] += sign * 2e-6
    at, size, _ = jumps(time, x)[0]
    assert time[row - 1] < at < time[row]
    assert size == pytest.approx(sign * 2e-6, rel=0.05)


@pytest.mark.parametrize("row", [70_000, PIECE - 1, PIECE, PIECE + 3])
def test_a_long_recording_is_looked_at_in_pieces_and_misses_none(row: int) -> None:
    """Wherever it lies beside the end of a piece, and once only."""
    rows = PIECE + 200_000
    time = np.arange(rows) / 1e4
    position = 1e-4 * np.sin(time) + 1e-9 * np.random.default_rng(3).standard_normal(rows)
    position[row:] += 5e-8
    (found,) = jumps(time, position)
    assert found.time == pytest.approx(time[row] - 0.5e-4, abs=1e-9)
    assert found.size == pytest.approx(5e-8, rel=0.1)


def test_a_smooth_motion_has_none() -> None:
    time, x = moved()
    assert all(abs(j.size) < 1e-7 for j in jumps(time, x))
    assert jumps(time[:8], x[:8]) == []


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.integers(100, 3900), st.sampled_from([-1.0, 1.0]))
def test_what_the_motion_does_stands_out_less_than_a_jump_of_a_few_counts(
    seed: int, row: int, sign: float
) -> None:
    """Strokes of 5 mm/s turned within 50 ms; the sensor counts 0.1 um, and flickers a fifth of it."""
    time = np.arange(4000) / 1000.0
    speed = 0.005 * zero_phase(np.sign(np.sin(6.0 * time)), 10.0, 1e3)
    x = np.cumsum(speed) / 1000.0 + 2e-8 * np.random.default_rng(seed).standard_normal(4000)
    assert all(abs(j.size) < 9e-7 for j in jumps(time, np.round(x / 1e-7) * 1e-7))
    x[row:] += sign * 2e-6
    found = jumps(time, np.round(x / 1e-7) * 1e-7)
    assert [j.size for j in found if time[row - 1] < j.time < time[row]] == [
        pytest.approx(sign * 2e-6, abs=5e-7)
    ]


def test_a_step_that_the_controller_takes_back_is_no_outlier_but_a_spike_is() -> None:
    _, x = moved()
    stepped = x.copy()
    stepped[2000:] += 5e-5 * np.exp(-np.arange(2000) / 8.0)
    assert not outliers(stepped)[1990:2020].any()
    spiked = x.copy()
    spiked[2000:2002] += 5e-5
    assert outliers(spiked)[2000:2002].all()


def test_the_command_that_answers_a_step_is_told_from_one_that_does_not() -> None:
    _, x = moved()
    x[2000:] += 5e-5
    answered = answers(x)
    assert answered[2000:2004].all()
    assert not answered[:1990].any() and not answered[2020:].any()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2 * MOST_ROWS - 50), st.sampled_from([-1.0, 1.0]))
def test_windows_of_a_long_recording_do_not_miss_a_jump(row: int, sign: float) -> None:
    time, x = moved(rows=2 * MOST_ROWS)
    x[row + 25 :] += sign * 2e-6
    data = load_data([Recording({"time": time, "position": x, "voltage": np.cos(time)}, 1000.0)])
    rows = MOST_ROWS // WINDOWS
    starts = [int(np.searchsorted(time, s.time[0])) for s in data.segments]
    assert [s.time.size for s in data.segments] == [rows] * WINDOWS
    assert all(np.diff(starts) >= rows) and starts[0] >= 0 and starts[-1] <= time.size - rows
    assert any(first + RUN_IN * rows * (first > 0) <= row + 25 < first + rows for first in starts)
    assert data.jumps[0].time == pytest.approx((row + 24.5) / 1000.0)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(0, 99_999), max_size=7), st.integers(40_000, 100_000))
def test_windows_are_moved_to_what_happens_once(wanted: list[int], size: int) -> None:
    """They stay apart and within the recording; the first of the rows is always seen."""
    rows, wanted = 9_000, [row % size for row in wanted]
    starts = with_rows(np.linspace(0, size - rows, WINDOWS).astype(np.int64), wanted, rows, size)
    assert all(np.diff(starts) >= rows) and starts[0] >= 0 and starts[-1] <= size - rows

    def seen(row: int) -> bool:
        return any(at + RUN_IN * rows * (at > 0) <= row < at + rows for at in starts.tolist())

    assert all(seen(row) for row in wanted[:1])


def test_a_command_that_is_large_once_is_in_a_window() -> None:
    time, x = moved(rows=2 * MOST_ROWS)
    volts = np.cos(time)
    volts[23_000:23_150] = 9.0
    data = load_data([Recording({"time": time, "position": x, "voltage": volts}, 1000.0)])
    assert max(s.voltage.max() for s in data.segments) == 9.0
