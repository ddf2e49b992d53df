"""Every benchmark as `make bench` runs it, at its shortest: it runs, and states the figures it is there for.

Whether a figure meets its target is not judged here, except where it does not depend on the machine.
"""

from __future__ import annotations

import gzip
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

TOP = Path(__file__).resolve().parents[2]
BENCHMARKS = sorted(path.name for path in (TOP / "tools").glob("bench_*.py"))


def bench(name: str, *arguments: object, timeout: float = 600.0) -> str:
    # Two cores as everywhere where figures are judged: every further one takes memory of its own.
    done = subprocess.run(
        [sys.executable, f"tools/{name}", *map(str, arguments)], cwd=TOP, capture_output=True, text=True,
        timeout=timeout, stdin=subprocess.DEVNULL, env={**os.environ, "NUMBA_NUM_THREADS": "2"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def figures(folder: Path, name: str, *arguments: object) -> dict[str, dict[str, Any]]:
    """Run a benchmark; check that table and JSON hold the same figures, all of them numbers; return them."""
    path = folder / "figures.json"
    printed = " ".join(bench(name, *arguments, "--json", path).split())
    found: dict[str, dict[str, Any]] = {f["name"]: f for f in json.loads(path.read_text())["figures"]}
    for figure in found.values():
        assert math.isfinite(figure["value"]), figure
        assert f"{figure['value']:.4g} {figure['unit']}".strip() in printed
    return found


def missed(found: dict[str, dict[str, Any]]) -> list[str]:
    return [name for name, figure in found.items() if figure["met"] is False]


def test_there_are_benchmarks() -> None:
    assert len(BENCHMARKS) >= 7


@pytest.mark.parametrize("name", BENCHMARKS)
def test_it_says_what_it_takes(name: str) -> None:
    assert "--json" in bench(name, "--help")


def test_without_the_recording_it_skips() -> None:
    assert bench("bench_measured.py").startswith("skipped: ")


@pytest.mark.slow
def test_a_joint_like_the_measured_one(tmp_path: Path) -> None:
    from rtcomp.hysteresis.interval import IntervalBasis
    from rtcomp.hysteresis.model import HysteresisModel

    rate = 100.0
    time = np.arange(0.0, 312.4, 1 / rate)
    amplitude = np.interp(time, [0.0, 288.0, 290.0, 312.4], [2e-4, 6e-4, 7e-4, 7e-4])
    position = amplitude * np.sin(2 * np.pi * 0.1 * time)
    joint = HysteresisModel(IntervalBasis.over(30, 9e-4), np.linspace(800.0, 20.0, 30))
    torque = joint.response(position)
    noise = np.random.default_rng(3).standard_normal(time.size)
    rows = np.column_stack([time, position, torque, torque + 1e-3 * noise])
    file = tmp_path / "joint.csv.gz"
    with gzip.open(file, "wt") as out:
        head = "t_s,position_rad,effort_commanded_Nm,effort_measured_Nm"
        np.savetxt(out, rows, "%.10g", ",", header=head, comments="")
    found = figures(tmp_path, "bench_measured.py", file)
    assert found["... relative to the peak"]["value"] < 5.0


@pytest.mark.slow
def test_the_papers_case(tmp_path: Path) -> None:
    found = figures(tmp_path, "bench_paper.py", "--seeds", 1)
    assert missed(found) == []
    raw = found["raw RLS with noise, ten cycles, median"]["value"]
    assert raw > 5.0 * found["with noise, ten cycles, median"]["value"]


@pytest.mark.slow
def test_tracking(tmp_path: Path) -> None:
    assert missed(figures(tmp_path, "bench_tracking.py")) == []


@pytest.mark.slow
@pytest.mark.realtime
def test_speed(tmp_path: Path) -> None:
    found = figures(tmp_path, "bench_speed.py", "--no-demo", "--seconds", 2)
    assert found["faster than numpy, sample by sample"]["value"] > 20.0
    assert found["1000 intervals over 20, fine motion"]["value"] < 4.0


@pytest.mark.slow
@pytest.mark.realtime
def test_a_diagnosis_without_recordings_to_judge(tmp_path: Path) -> None:
    found = figures(tmp_path, "bench_diagnosis.py", "--seconds", 15, "--minutes", 3)
    assert "cogging" in found["15 s at 1 kHz: everything"]["note"]
    assert found["15 s at 1 kHz: where, on the terminal after"]["value"] < 10.0
    # Four columns of a float64, twice over (0.12 GB), the program by itself, and what a search remembers,
    # which does not grow with the recording.
    assert found["3 min at 10 kHz: memory"]["value"] < 1.2


@pytest.mark.slow
def test_every_pair_of_stage_and_recording_ends_in_an_answer_or_a_line(tmp_path: Path) -> None:
    found = figures(tmp_path, "bench_answers.py", "--pairs", 6, "--seed", 7, "--jobs", 2)
    assert found["neither"]["value"] == 0.0


@pytest.mark.slow
def test_places(tmp_path: Path) -> None:
    found = figures(tmp_path, "bench_places.py", "--curves", 30)
    for noise in ("0", "0.5"):
        head = f"noise {noise} % of peak: "
        assert found[head + "20 placed over 20 equal, median"]["value"] < 0.6
        assert found[head + "8 placed over 20 equal, median"]["value"] < 1.7
    assert found["noise 0 % of peak: worst over equal"]["value"] < 1.1


@pytest.mark.slow
def test_drift(tmp_path: Path) -> None:
    assert missed(figures(tmp_path, "bench_drift.py", "--minutes", 3)) == []


@pytest.mark.slow
@pytest.mark.realtime
def test_a_killed_run_keeps_its_file(tmp_path: Path) -> None:
    found = figures(tmp_path, "bench_kill.py", "--kills", 1)
    for who in ("loop", "loop and recorder"):
        assert found[f"{who} killed: files that open"]["value"] == 1.0


def test_damage_into_the_hosts_end(tmp_path: Path) -> None:
    found = figures(tmp_path, "bench_fuzz.py", "--bytes", 200_000)
    assert found["bad ones among them"]["value"] == 0.0
    assert found["messages accepted"]["value"] > 500


@pytest.mark.slow
@pytest.mark.realtime
def test_lateness_beside_its_rivals(tmp_path: Path) -> None:
    found = figures(tmp_path, "bench_lateness.py", "--seconds", 0.5, "--rate", 500, "--rate", 1000)
    for head in ("0.5 kHz", "1 kHz", "1 kHz, serial link"):
        assert 0.0 <= found[f"{head}: slots missed"]["value"] <= 100.0
        assert sum(name.startswith(f"{head}: ") for name in found) == 5


@pytest.mark.slow
@pytest.mark.realtime
def test_round_trips_beside_raw_ones(tmp_path: Path) -> None:
    found = figures(tmp_path, "bench_roundtrip.py", "--seconds", 0.5, "--rate", 200)
    assert found["serial, board in Python: exchanges otherwise than well"]["unit"] == "of 100"
    assert found["serial, board in Python: p50 over raw"]["target"] == "<= 1.3"
    assert found["odrive-can on slcan: exchanges otherwise than well"]["unit"] == "of 100"
    assert found["odrive-can on slcan: p50 over python-can"]["target"] == "<= 1.2"


@pytest.mark.slow
@pytest.mark.realtime
def test_a_loop_killed_and_one_stopped(tmp_path: Path) -> None:
    found = figures(tmp_path, "bench_watchdog.py", "--moments", 1)
    for number in ("SIGKILL", "SIGSTOP"):
        head = f"board in Python, {number}"
        assert found[f"{head}: zeroed by the watchdog"]["value"] == 1.0
        assert found[f"{head}: a new host is refused"]["value"] == 1.0
        assert found[f"{head}: DISARMED once cleared"]["value"] == 1.0
        assert found[f"{head}: output when armed again, most"]["value"] == 0.0


@pytest.mark.slow
@pytest.mark.realtime
def test_endurance_in_short(tmp_path: Path) -> None:
    found = figures(tmp_path, "bench_endurance.py", "--hours", 0.002, "--wall", 0.05)
    for head in ("0.002 h virtual at 10 kHz", "0.05 min over serial at 1 kHz"):
        assert found[f"{head}: rows in the file"]["value"] == 100.0
        assert found[f"{head}: counters off"]["value"] == 0.0
    assert found["0.002 h virtual at 10 kHz: slots lost"]["value"] == 0.0


@pytest.mark.slow
@pytest.mark.realtime
def test_the_serial_link(tmp_path: Path) -> None:
    for _ in range(3):
        try:
            found = figures(tmp_path, "bench_link.py", "--seconds", 4)
        except AssertionError as error:
            if "exchanges in a row" not in str(error):
                raise
            continue  # the kernel kept the samples back for longer than the watchdog's time
        assert found["runs with every tick in the recording"]["value"] == 4.0
        return
    pytest.skip("this machine had no quiet quarter of a minute for a link in real time")


@pytest.mark.slow
def test_shapes_and_rivals(tmp_path: Path) -> None:
    """On loops made up with a Preisach plane, in the file's form, and the simulated rig."""
    from scipy.io import savemat

    from rtcomp.hysteresis.basis import regressors
    from rtcomp.hysteresis.preisach import PreisachBasis

    plane = PreisachBasis(7, 2000.0)
    rows, columns = np.tril_indices(7)
    density = 0.05 + 0.02 * rows + 0.01 * columns * (rows > 3)
    record = {}
    for name, volts in (("08", 800), ("1", 1000), ("11", 1100), ("15", 1500), ("19", 1900)):
        u = volts * np.interp(np.arange(161), [0, 40, 120, 160], [0.0, 1.0, -1.0, 0.0])
        moved = (regressors(plane, np.concatenate([[0.0], u, u])) @ density)[-161:]
        record |= {f"Vplus_{name}kv": u, f"Displacement_{name}kv": moved - moved[0]}
    (tmp_path / "piezo").mkdir()
    savemat(tmp_path / "piezo" / "MeasurementData.mat", record)
    found = figures(tmp_path, "bench_shapes.py", tmp_path, "--quick")
    assert found["piezo, with shape"]["met"] and found["failing rig, three cycles"]["met"]
    assert found["kernels a tick, 20 intervals, everything on"]["value"] < 10.0
