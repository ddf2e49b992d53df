"""Outliers are marked where they are, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from recording_files import motion, write_hdf5
from scipy.signal import lfilter

from rtcomp.recording.outliers import ANSWER, COMMAND_THRESHOLD, lawful, outliers
from rtcomp.recording.reader import read


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.integers(60, 1900), min_size=1, max_size=8, unique=True),
    st.sampled_from(["position", "voltage"]),
    st.sampled_from([-1.0, 1.0]),
)
def test_outliers_are_marked_not_dropped(tmp_path: Path, rows: list[int], column: str, sign: float) -> None:
    rows = [row for row in rows if all(abs(row - other) > 6 for other in rows if other != row)]
    columns = motion(2000)
    columns[column][rows] += sign * (5e-5 if column == "position" else 3.0)
    recording = read(write_hdf5(tmp_path / "a.h5", columns))
    assert np.array_equal(recording.columns[column], columns[column])
    assert np.array_equal(np.flatnonzero(recording.columns.get("outlier", np.zeros(1))), sorted(rows))
    assert not rows or any(f"in {column}" in note for note in recording.notes)


def test_steps_and_fast_oscillations_are_no_outliers(tmp_path: Path) -> None:
    columns = motion(4000)
    columns["position"] += 1e-4 * (columns["time"] > 1.5)
    burst = np.exp(-(((columns["time"] - 2.5) / 0.05) ** 2)) * np.sin(2 * np.pi * 90 * columns["time"])
    columns["position"] += 1e-4 * burst
    columns["voltage"] = 5.0 * np.sign(np.sin(2 * np.pi * 7 * columns["time"] + 0.1))
    assert "outlier" not in read(write_hdf5(tmp_path / "a.h5", columns)).columns


def driven(gains: tuple[float, float, float], count: float, rate: float) -> dict[str, np.ndarray]:
    """A controller's answers, kicks included, to an axis read in counts."""
    time = np.arange(4000) / rate
    slow = 0.15 * count * rate  # a count every seven rows
    reference = 1e-4 * np.sin(slow / 1e-4 * time)
    noise = 0.02 * count * np.random.default_rng(3).standard_normal(time.size)
    position = np.round((np.roll(reference, 4) + noise) / count) * count
    position[:4] = 0.0
    error = reference - position
    kp, ki, kd = gains
    voltage = kp * error + ki * np.cumsum(error) / rate + kd * np.diff(error, prepend=0.0) * rate
    return {"time": time, "reference": reference, "position": position, "voltage": voltage}


@settings(max_examples=15, deadline=None)
@example((1000.0, 10438.0, 15.0), 1e-7, 500.0, 1775)  # the wrong sample where a count changes
@example((1000.0, 1730.0, 5.0), 2e-6, 500.0, 1125)
@given(
    st.tuples(st.floats(1e3, 1e4), st.floats(0.0, 1e5), st.floats(5.0, 100.0)),
    st.sampled_from([1e-7, 5e-7, 2e-6]),
    st.sampled_from([500.0, 2000.0]),
    st.integers(1000, 3000),
)
def test_kicks_of_a_controller_at_counts_of_its_sensor_are_no_outliers(
    gains: tuple[float, float, float], count: float, rate: float, row: int
) -> None:
    columns = driven(gains, count, rate)
    found = outliers(columns["voltage"], COMMAND_THRESHOLD)
    assert not (found & ~lawful(columns["voltage"], [columns["position"]], found)).any()
    wrong = columns["voltage"].copy()
    wrong[row] += 20.0 * np.ptp(wrong)
    found = outliers(wrong, COMMAND_THRESHOLD)
    left = np.flatnonzero(found & ~lawful(wrong, [columns["position"]], found))
    assert row in left and np.all(np.abs(left - row) <= 2)  # a kick beside it looks as wrong


def test_the_recording_keeps_them(tmp_path: Path) -> None:
    columns = driven((3e3, 2e4, 23.0), 1e-6, 1000.0)
    assert outliers(columns["voltage"], COMMAND_THRESHOLD).any()
    assert "outlier" not in read(write_hdf5(tmp_path / "a.h5", columns)).columns


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(1e-5, 1e-3), st.floats(0.5, 1.0), st.integers(1000, 3000))
@example(size=1e-3, pole=1.0, row=2148)
@example(size=1e-3, pole=0.7, row=2149)
def test_kicks_of_a_controller_at_steps_of_its_reference_are_no_outliers(
    tmp_path: Path, size: float, pole: float, row: int
) -> None:
    """The derivative of a stepped reference is in the command for a row or a few, and was really given.

    A wrong sample in these rows is not told from it; one before them is.
    """
    assume((row - 150) % 400 > ANSWER)
    time = np.arange(4000) / 1000.0
    reference = size * np.sin(3.0 * time)
    for at in range(150, 4000, 400):
        reference[at:] += 0.3 * size
    position = lfilter([0.02], [1.0, -0.98], reference)
    error = reference - position
    rate = lfilter([pole], [1.0, pole - 1.0], np.diff(error, prepend=error[0])) * 1000.0
    columns = {"time": time, "reference": reference, "position": position}
    columns["voltage"] = (0.5 * error + 0.02 * rate) / size
    assert outliers(columns["voltage"], COMMAND_THRESHOLD).any()
    assert "outlier" not in read(write_hdf5(tmp_path / "a.h5", columns)).columns
    columns["voltage"][row] += 20.0 * np.ptp(columns["voltage"])
    left = np.flatnonzero(read(write_hdf5(tmp_path / "b.h5", columns)).columns["outlier"])
    assert row in left


def test_a_long_recording_is_looked_at_piece_by_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    columns = driven((3e3, 2e4, 23.0), 1e-6, 1000.0)
    wrong = columns["voltage"].copy()
    wrong[[500, 1023, 1024, 3990]] += 20.0 * np.ptp(wrong)
    found = outliers(wrong, COMMAND_THRESHOLD)
    whole = lawful(wrong, [columns["position"]], found)
    monkeypatch.setattr("rtcomp.recording.pieces.PIECE", 1024)
    assert np.array_equal(lawful(wrong, [columns["position"]], found), whole)
    assert {500, 1023, 1024, 3990} <= set(np.flatnonzero(found & ~whole)) <= {499, 500, 1023, 1024, 3990}
