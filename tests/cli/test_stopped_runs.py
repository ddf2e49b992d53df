"""Runs that the user ends: in order, at zero volts, with what was measured kept and a status that says so."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from command import listing, rtcomp
from running import Plant, Running, configuration, link

from rtcomp.hysteresis.model import HysteresisModel

RESULTS = {
    ".rtcomp-files", "configuration.yaml", "model.yaml", "recording.h5", "report.html", "summary.json",
}  # fmt: skip
SIGNALS = pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)]
)


def stop(run: Running, recording: str, number: int, rows: int = 400) -> subprocess.CompletedProcess[str]:
    """Send the signal once the recording has so many rows; check status and line."""
    run.wait_for_rows(recording, rows)
    run.process.send_signal(number)
    ended = run.end()
    assert ended.returncode == 128 + number, (ended.stdout, ended.stderr)
    assert ended.stderr.startswith("interrupted; ") and ended.stderr.count("\n") == 1, ended.stderr
    return ended


def check_recording(path: Path, rows: int = 400) -> int:
    """Check that a recording is complete up to its end, and closed in order; return its rows."""
    with h5py.File(path, "r") as file:
        time = file["time"][:]
        assert bool(file.attrs["complete"]) and file.attrs["rows_lost"] == 0
        assert len(time) >= rows
        np.testing.assert_allclose(np.diff(time), 1e-3, rtol=1e-6)
        for name in ("position", "voltage", "reference"):
            assert len(file[name]) == len(time) and np.isfinite(file[name][:]).all()
    return len(time)


@SIGNALS
def test_identify_on_the_wall_clock_keeps_what_it_learned(tmp_path: Path, number: int) -> None:
    (tmp_path / "run.yaml").write_text(configuration())
    with Running("identify", "run.yaml", "--out", "out", "--json", at=tmp_path) as run:
        ended = stop(run, "out/recording.h5", number, 1000)
    assert "learning stopped after" in ended.stderr
    assert "results up to there are in out" in ended.stderr
    assert {p.name for p in (tmp_path / "out").iterdir()} == RESULTS
    assert {p.name for p in tmp_path.iterdir()} == {"run.yaml", "out"}
    rows = check_recording(tmp_path / "out" / "recording.h5", 1000)
    summary = json.loads(ended.stdout)
    assert summary["stopped_by"] == "signal" and summary["ticks"] == rows
    assert summary["held_out_error"] is None and 0.0 < summary["in_sample_error"] < 0.5
    assert float(re.findall(r"after ([0-9.]+) s", ended.stderr)[0]) == pytest.approx(rows / 1000, rel=1e-3)
    model = HysteresisModel.load(tmp_path / "out" / "model.yaml")
    assert np.any(model.weights != 0.0)
    again = rtcomp("simulate", "out/configuration.yaml", "--seconds", "1", "--out", "again", at=tmp_path)
    assert again.returncode == 0, again.stderr


@SIGNALS
def test_identify_over_the_link_ends_at_zero_volts(tmp_path: Path, number: int) -> None:
    with Plant(tmp_path) as plant:
        (tmp_path / "run.yaml").write_text(configuration(link(plant.port)))
        with Running("identify", "run.yaml", "--out", "out", "--json", at=tmp_path) as run:
            stop(run, "out/recording.h5", number)
        log = plant.stop()
    check_recording(tmp_path / "out" / "recording.h5")
    assert {p.name for p in (tmp_path / "out").iterdir()} == RESULTS
    # The host said so itself: no watchdog had to act.
    assert {zeroing["cause"] for zeroing in log["zeroings"]} == {"disarmed"}
    assert log["watchdog_trips"] == 0


def test_a_signal_while_judging_keeps_the_model(tmp_path: Path) -> None:
    (tmp_path / "run.yaml").write_text(configuration(seconds=1.0))
    with Running("identify", "run.yaml", "--out", "out", "--json", at=tmp_path) as run:
        ended = stop(run, "out/judge.h5", signal.SIGINT)
    assert "judging stopped after" in ended.stderr
    assert {p.name for p in (tmp_path / "out").iterdir()} == RESULTS | {"judge.h5"}
    summary = json.loads(ended.stdout)
    assert summary["stopped_by"] == "signal" and summary["held_out_error"] is None
    assert check_recording(tmp_path / "out" / "recording.h5", 1000) == 1000
    check_recording(tmp_path / "out" / "judge.h5")


@SIGNALS
def test_an_earlier_runs_results_are_not_given_up_for_half_a_run(tmp_path: Path, number: int) -> None:
    (tmp_path / "run.yaml").write_text(configuration())
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "model.yaml").write_text("of an earlier run")
    before = listing(tmp_path / "out")
    with Running("identify", "run.yaml", "--out", "out", "--force", "--json", at=tmp_path) as run:
        ended = stop(run, f"out.new-{run.process.pid}/recording.h5", number)
    assert "kept in out.failed" in ended.stderr
    assert listing(tmp_path / "out") == before
    assert {p.name for p in tmp_path.iterdir()} == {"run.yaml", "out", "out.failed"}
    check_recording(tmp_path / "out.failed" / "recording.h5")
    assert np.any(HysteresisModel.load(tmp_path / "out.failed" / "model.yaml").weights != 0.0)


@SIGNALS
def test_compensate_over_the_link_does_not_begin_its_second_run(tmp_path: Path, number: int) -> None:
    (tmp_path / "model.yaml").write_text("model: interval\nwidths: [2.0e-5, 4.0e-5]\nweights: [1e5, 5e4]\n")
    with Plant(tmp_path) as plant:
        (tmp_path / "run.yaml").write_text(configuration(link(plant.port)))
        given = ["compensate", "run.yaml", "--model", "model.yaml", "--out", "out", "--json"]
        with Running(*given, at=tmp_path) as run:
            ended = stop(run, "out/without.h5", number)
        log = plant.stop()
    assert ended.stdout == ""
    assert "stopped after" in ended.stderr and "at zero volts" in ended.stderr
    assert "kept in out.failed" in ended.stderr
    assert {p.name for p in (tmp_path / "out.failed").iterdir()} == {"without.h5"}
    check_recording(tmp_path / "out.failed" / "without.h5")
    assert {zeroing["cause"] for zeroing in log["zeroings"]} == {"disarmed"}


def test_a_signal_before_anything_moves_leaves_nothing(tmp_path: Path) -> None:
    """At a silent port, while it waits for an answer."""
    import os
    import time

    master, slave = os.openpty()
    device = f"{{driver: serial, port: {os.ttyname(slave)}, connect_timeout: 30}}"
    (tmp_path / "run.yaml").write_text(configuration(device))
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            with Running("identify", "run.yaml", "--out", "out", at=tmp_path) as run:
                end = time.monotonic() + 30.0
                while not os.read(master, 4096):
                    assert time.monotonic() < end
                run.process.send_signal(number)
                ended = run.end()
            assert ended.returncode == 128 + number
            assert ended.stderr.startswith("interrupted") and ended.stderr.count("\n") == 1
            assert not (tmp_path / "out").exists()
    finally:
        os.close(master)
        os.close(slave)
