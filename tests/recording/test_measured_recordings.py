"""Recordings that others measured, read as they are."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import numpy as np
from recording_files import data, refusal

from rtcomp.recording.reader import read


def test_heads_yaw() -> None:
    path = data("real/heads-yaw/yaw_sine_to_330s.csv.gz")
    begin = time.perf_counter()
    recording = read(path, {"time": "t_s", "position": "position_rad", "voltage": "effort_measured_Nm"})
    assert time.perf_counter() - begin < 2.0
    assert abs(recording.rate_hz - 1000 / 3) < 0.1 and len(recording) > 100_000
    assert 0 < recording.columns["outlier"].sum() < 300
    assert any("uneven" in note for note in recording.notes)
    assert abs(np.ptp(recording.position) - 0.000599) < 3e-5


def test_emps() -> None:
    path = data("real/emps/DATA_EMPS.mat")
    recording = read(path, {"time": "t", "position": "qm", "voltage": "vir", "reference": "qg"})
    assert recording.rate_hz == 1000.0 and len(recording) == 24841 and recording.notes == []
    assert recording.metadata["kp"] == 160.18
    assert "found 'qg', 'qm', 't', 'vir'" in refusal(path)


def test_servo_pendulum() -> None:
    for path in sorted(data("real/servo-pendulum").glob("*.csv")):
        recording = read(path, {"voltage": "duty"})
        assert 185 <= recording.rate_hz <= 290 and any("uneven" in note for note in recording.notes)
        assert "gap" not in recording.columns and "outlier" not in recording.columns


def test_sealed_cases_are_even_and_nearly_free_of_marks() -> None:
    for path in sorted(data("sealed-dev").glob("*/*.csv.gz")):
        recording = read(path)
        assert recording.rate_hz == 1000.0 and len(recording) == 30_000
        assert recording.columns.get("outlier", np.zeros(1)).sum() <= 60
        assert not any("outliers in position" in note for note in recording.notes)


def test_truncated_copy_of_emps(tmp_path: Path) -> None:
    shutil.copy(data("real/emps/DATA_EMPS.mat"), tmp_path / "a.mat")
    (tmp_path / "a.mat").chmod(0o644)
    with (tmp_path / "a.mat").open("r+b") as file:
        file.truncate(400_000)
    said = refusal(tmp_path / "a.mat", {"time": "t", "position": "qm", "voltage": "vir"})
    assert "truncated" in said and "bytes are missing" in said
