"""Outliers are marked where they are, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recording_files import motion, write_hdf5

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
