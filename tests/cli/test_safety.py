"""Hardware that nobody asked to move, emergency stops: real processes, a plant that says it is hardware."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from command import CONFIG, RTCOMP, environment, listing, one_error_line, rtcomp
from running import PATIENCE_S, Plant, Running, configuration, link

from rtcomp.loop.states import State
from rtcomp.recording.reader import read

HARDWARE = """
import sys
from rtcomp_drivers import board, plant_server
facts = board.BoardFacts
board.BoardFacts = lambda **given: facts(**{**given, "text": "stage drive 7"})
plant_server.main(["--config", "plant.yaml", "--serial", "--json", "--log", "plant.json"])
"""
"""The plant server, but for what it says of itself."""


class Hardware(Plant):
    def __init__(self, folder: Path) -> None:
        (folder / "plant.yaml").write_text(CONFIG)
        self.at = folder
        self.process = subprocess.Popen(
            [sys.executable, "-c", HARDWARE], cwd=folder, env=environment(), text=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        assert self.process.stdout is not None
        self.port: str = json.loads(self.process.stdout.readline())["port"]


@pytest.fixture()
def hardware(tmp_path: Path) -> Iterator[Hardware]:
    with Hardware(tmp_path) as plant:
        (tmp_path / "run.yaml").write_text(configuration(link(plant.port), seconds=1.0, judged=1.0))
        (tmp_path / "model.yaml").write_text(
            "model: interval\nwidths: [2.0e-5, 4.0e-5]\nweights: [1e5, 5e4]\n"
        )
        yield plant


@pytest.mark.parametrize("command", ["identify", "compensate"])
def test_hardware_that_nobody_asked_to_move_is_looked_at_and_left_alone(
    tmp_path: Path, hardware: Hardware, command: str
) -> None:
    before = listing(tmp_path)
    model = ["--model", "model.yaml"] if command == "compensate" else []
    run = rtcomp(command, "run.yaml", *model, "--out", "out", at=tmp_path)
    line = one_error_line(run, [hardware.port, "stage drive 7", "nothing was armed", "give --armed", "10 V"])
    assert "is ready and stands at" in line
    assert listing(tmp_path) == before
    log = hardware.stop()
    assert log["zeroings"] == [] and log["watchdog_trips"] == 0  # never armed, so never zeroed


def test_asked_for_it_moves_and_the_recording_says_so(tmp_path: Path, hardware: Hardware) -> None:
    run = rtcomp("identify", "run.yaml", "--armed", "--allow-non-rt", "--out", "out", "--json", at=tmp_path)
    assert run.returncode == 0, run.stderr
    recording = read(tmp_path / "out" / "recording.h5")
    assert recording.metadata["armed"] == recording.metadata["allow_non_rt"] == 1
    assert {e.text for e in recording.events[:2]} & {"RUNNING", "DEGRADED"}
    assert recording.events[-1].text == "ended by end"
    log = hardware.stop()
    assert {zeroing["cause"] for zeroing in log["zeroings"]} == {"disarmed"}


def test_a_machine_without_real_time_rights_does_not_move_hardware(
    tmp_path: Path, hardware: Hardware
) -> None:
    """The rights are really taken away: a user that may neither schedule in real time nor lock memory."""
    limited = (
        "import os, resource, sys; resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0)); "
        "resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0)); os.execv(sys.argv[1], sys.argv[1:])"
    )
    drop = ["setpriv", "--bounding-set=-sys_nice,-ipc_lock", "--inh-caps=-sys_nice,-ipc_lock"]
    command = [
        *drop,
        sys.executable,
        "-c",
        limited,
        RTCOMP,
        "identify",
        "run.yaml",
        "--armed",
        "--out",
        "out",
    ]
    try:
        run = subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, env=environment(), timeout=120.0,
            stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
    except FileNotFoundError:
        pytest.skip("no setpriv here to take the rights away")
    if "setpriv" in run.stderr:
        pytest.skip(f"the rights cannot be taken away here: {run.stderr.strip()}")
    line = one_error_line(run, ["SCHED_FIFO", "nothing was armed", "--allow-non-rt", "rtcomp doctor"])
    assert not (tmp_path / "out").exists() and "locked memory" in line
    assert hardware.stop()["zeroings"] == []


def test_the_stop_file_stops_and_while_it_is_there_nothing_starts(tmp_path: Path) -> None:
    with Plant(tmp_path) as plant:
        (tmp_path / "run.yaml").write_text(configuration(link(plant.port)))
        given = ["identify", "run.yaml", "--stop-file", "STOP", "--out", "out", "--json"]
        with Running(*given, at=tmp_path) as run:
            run.wait_for_rows("out/recording.h5", 400)
            (tmp_path / "STOP").touch()
            ended = run.end()
        one_error_line(ended, ["emergency stop by the stop file", "kept in out.failed"])
        recording = read(tmp_path / "out.failed" / "recording.h5")
        assert recording.columns["state"][-1] == State.FAULT and recording.voltage[-1] == 0.0
        assert recording.events[-1].state == State.FAULT
        assert recording.events[-1].text.startswith("emergency stop by the stop file at tick")
        assert abs(recording.events[-1].time - recording.time[-1]) < 0.01
        again = rtcomp(*given, at=tmp_path)
        one_error_line(again, ["emergency stop by the stop file: nothing was armed"])
        log = plant.stop()
    # Told to by the host, once, well before any watchdog.
    assert [zeroing["cause"] for zeroing in log["zeroings"]] == ["disarmed"]


@pytest.mark.parametrize("key", [b" ", pytest.param(b"\r", marks=pytest.mark.slow)])
def test_a_key_is_an_emergency_stop(tmp_path: Path, key: bytes) -> None:
    """On a terminal of its own, which afterwards is as it was."""
    import pty
    import termios

    with Plant(tmp_path) as plant:
        (tmp_path / "run.yaml").write_text(configuration(link(plant.port)))
        pid, terminal = pty.fork()
        if pid == 0:
            os.chdir(tmp_path)
            os.execve(RTCOMP, [RTCOMP, "identify", "run.yaml", "--out", "out"], environment())
        before = termios.tcgetattr(terminal)
        shown = _until(terminal, pid, tmp_path / "out" / "recording.h5", key)
        assert b"emergency stop by a key" in shown, shown.decode()
        assert termios.tcgetattr(terminal) == before
        os.close(terminal)
        log = plant.stop()
    assert [zeroing["cause"] for zeroing in log["zeroings"]] == ["disarmed"]


def _until(terminal: int, pid: int, recording: Path, key: bytes) -> bytes:
    """Read what the terminal shows to its end; press the key once the run records."""
    from running import rows_now

    shown, pressed, end = b"", False, time.monotonic() + PATIENCE_S
    while True:
        assert time.monotonic() < end, shown.decode()
        if select.select([terminal], [], [], 0.05)[0]:
            try:
                more = os.read(terminal, 65536)
            except OSError:
                break
            if not more:
                break
            shown += more
        if not pressed and rows_now(recording) > 300:
            os.write(terminal, b"x" + key)
            pressed = True
    _, status = os.waitpid(pid, 0)
    assert os.waitstatus_to_exitcode(status) == 2
    return shown


def test_ctrl_c_in_the_countdown_ends_it_before_anything_moves(tmp_path: Path, hardware: Hardware) -> None:
    import pty

    pid, terminal = pty.fork()
    if pid == 0:
        os.chdir(tmp_path)
        command = [RTCOMP, "identify", "run.yaml", "--armed", "--allow-non-rt", "--out", "out"]
        os.execve(RTCOMP, command, environment())
    shown, end = b"", time.monotonic() + PATIENCE_S
    while b"Arming; Ctrl-C stops" not in shown:
        assert time.monotonic() < end
        shown += os.read(terminal, 65536)
    os.kill(pid, signal.SIGINT)
    _, status = os.waitpid(pid, 0)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(status) == 130
    assert not (tmp_path / "out").exists()
    log: dict[str, Any] = hardware.stop()
    assert log["zeroings"] == []
