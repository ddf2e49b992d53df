"""Rows that are not evenly spaced: rates, jitter, gaps, resampling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recording_files import motion, refusal, write_csv_text, write_hdf5

from rtcomp.errors import ConfigError
from rtcomp.recording.reader import read


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, 1e9])
def test_rates_that_make_no_sense(tmp_path: Path, rate: float) -> None:
    with pytest.raises(ConfigError, match="allowed"):
        read(write_csv_text(tmp_path / "a.csv", motion()), rate_hz=rate)
    with pytest.raises(ConfigError, match="cubic, linear"):
        read(tmp_path / "a.csv", method="magic")


def test_no_time_column_but_a_rate(tmp_path: Path) -> None:
    columns = motion()
    del columns["time"]
    recording = read(write_csv_text(tmp_path / "a.csv", columns), rate_hz=250.0)
    assert recording.rate_hz == 250.0 and recording.time[-1] == 499 / 250.0
    assert "no time" in recording.notes[0]


def test_repeated_times_are_left_out_and_said(tmp_path: Path) -> None:
    columns = {name: np.insert(column, 40, column[40]) for name, column in motion().items()}
    columns["position"][41] = 1.0  # the second row of that time
    recording = read(write_csv_text(tmp_path / "a.csv", columns))
    assert np.array_equal(recording.position, motion()["position"])
    assert recording.notes == ["1 row of a time already seen (first: row 42): left out"]


def test_small_jitter_is_taken_as_even(tmp_path: Path) -> None:
    columns = motion()
    columns["time"] = columns["time"] + 5e-5 * np.random.default_rng(0).uniform(-1, 1, 500)
    recording = read(write_csv_text(tmp_path / "a.csv", columns))
    assert np.array_equal(recording.position, columns["position"])
    assert np.allclose(np.diff(recording.time), 1 / recording.rate_hz, rtol=1e-6)
    assert abs(recording.rate_hz / 1000.0 - 1) < 1e-3
    assert "jitter by" in recording.notes[0]


@pytest.mark.parametrize(("method", "error"), [("cubic", 2e-3), ("linear", 5e-3)])
def test_uneven_rows_become_even(tmp_path: Path, method: str, error: float) -> None:
    at = np.cumsum(np.random.default_rng(3).uniform(0.6e-3, 1.4e-3, 3000))
    columns = {"time": at, "position": np.sin(2 * np.pi * 9 * at), "voltage": np.cos(2 * np.pi * 9 * at)}
    columns["status"] = np.floor(at)
    recording = read(write_csv_text(tmp_path / "a.csv", columns), method=method)
    assert abs(recording.rate_hz / 1000.0 - 1.0) < 0.05
    assert np.allclose(np.diff(recording.time), 1 / recording.rate_hz)
    truth = np.sin(2 * np.pi * 9 * recording.time)
    assert np.max(np.abs(recording.position - truth)) < error
    assert set(recording.columns["status"]) == {0.0, 1.0, 2.0, 3.0} - (set() if at[-1] > 3 else {3.0})
    assert any("resampled from uneven rows" in note for note in recording.notes)


def test_a_lower_rate_does_not_fold_back(tmp_path: Path) -> None:
    time_s = np.arange(20_000) / 1000.0
    slow, fast = np.sin(2 * np.pi * 2.0 * time_s), np.sin(2 * np.pi * 203.0 * time_s)
    path = write_hdf5(
        tmp_path / "a.h5",
        {"time": time_s, "position": slow + fast, "voltage": slow - fast, "learning": 0 * slow},
    )
    recording = read(path, rate_hz=100.0)
    inner = slice(20, -20)
    truth = np.sin(2 * np.pi * 2.0 * recording.time)
    assert recording.rate_hz == 100.0 and len(recording) == 2000
    assert np.max(np.abs(recording.position - truth)[inner]) < 0.01  # 203 Hz would show as 3 Hz, amplitude 1
    assert np.max(np.abs(recording.voltage - truth)[inner]) < 0.01
    assert "low-passed" in recording.notes[0]


def test_gaps_are_bridged_and_marked(tmp_path: Path) -> None:
    columns = motion(2000)
    kept = np.ones(2000, dtype=bool)
    kept[700:800] = kept[1500] = False
    recording = read(write_csv_text(tmp_path / "a.csv", {n: c[kept] for n, c in columns.items()}))
    assert np.array_equal(np.flatnonzero(recording.columns["gap"]), [*range(700, 800), 1500])
    assert np.array_equal(recording.trusted, kept)
    assert np.allclose(recording.position[kept], columns["position"][kept], rtol=0, atol=1e-12)
    assert "2 gaps, longest 0.101 s at 0.699 s: 101 rows bridged" in recording.notes[-1]


def test_a_jump_in_time_does_not_eat_the_memory(tmp_path: Path) -> None:
    columns = motion()
    columns["time"][250:] += 1e9
    assert "time jumps by 1e+09 s in row 251" in refusal(write_csv_text(tmp_path / "a.csv", columns))
