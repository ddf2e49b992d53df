"""Ports with nobody, or the wrong one, at their other end: real pseudo-terminals and real processes."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from command import listing, one_error_line, refused
from held_port import held
from running import Plant, Running, configuration, link


@pytest.fixture()
def folder(tmp_path: Path) -> Path:
    """A folder with results of earlier runs, which must survive."""
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "recording.h5").write_bytes(b"of an earlier run")
    (tmp_path / "model.yaml").write_text("model: interval\nwidths: [2.0e-5, 4.0e-5]\nweights: [1e5, 5e4]\n")
    return tmp_path


@contextlib.contextmanager
def terminal(answer: Callable[[bytes], bytes] = lambda _: b"") -> Iterator[str]:
    """A pseudo-terminal whose other end says `answer` of what it hears; by default it is silent."""
    master, slave = os.openpty()
    tty.setraw(slave)
    ended = threading.Event()

    def talk() -> None:
        while not ended.is_set():
            os.write(master, answer(os.read(master, 4096)))

    thread = threading.Thread(target=talk, daemon=True)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        ended.set()
        os.write(slave, b"x")  # wakes the thread
        thread.join()
        os.close(master)
        os.close(slave)


def arguments(command: str) -> list[str]:
    extra = ["--model", "model.yaml"] if command == "compensate" else []
    return [command, "run.yaml", *extra, "--out", "results", "--force", "--json"]


def use(folder: Path, port: str) -> None:
    device = f"{{driver: serial, port: {port}, connect_timeout: 0.4}}"
    (folder / "run.yaml").write_text(configuration(device))


def use_plant(folder: Path, plant: Plant) -> None:
    (folder / "run.yaml").write_text(configuration(link(plant.port)))


COMMANDS = pytest.mark.parametrize("command", ["identify", "compensate"])


@COMMANDS
def test_what_is_no_serial_port(folder: Path, command: str) -> None:
    (folder / "file").write_text("mine")
    for port, says in (
        ("/dev/none", ["/dev/none does not exist", "ports"]),
        (str(folder / "file"), ["is a regular file, not a serial port"]),
        (str(folder), ["is a directory, not a serial port"]),
        ("/dev/null", ["/dev/null is not a serial port"]),
    ):
        use(folder, port)
        refused(*arguments(command), at=folder, says=["serial port", *says])
    (folder / "run.yaml").write_text(configuration())
    refused(*arguments(command), "--port", "/dev/none", at=folder, says=["/dev/none does not exist"])


@COMMANDS
def test_a_port_that_another_process_holds(folder: Path, command: str) -> None:
    with terminal() as port:
        use(folder, port)
        with held(port):
            refused(*arguments(command), at=folder, says=[port, "is busy", "another program has it open"])


@COMMANDS
def test_a_port_at_which_nobody_answers(folder: Path, command: str) -> None:
    with terminal() as port:
        use(folder, port)
        refused(*arguments(command), at=folder, says=[port, "nothing answered in 0.4 s", "powered"])


@COMMANDS
def test_a_port_that_belongs_to_something_else(folder: Path, command: str) -> None:
    chance = np.random.default_rng(1)
    for answer, says in (
        (lambda heard: chance.bytes(len(heard)), "belongs to something else"),
        (lambda _: b"login: \r\n", "belongs to something else"),
        (lambda heard: heard, "sends back what it is sent"),
    ):
        with terminal(answer) as port:
            use(folder, port)
            refused(*arguments(command), at=folder, says=[port, says])


def test_a_plant_with_another_axis(folder: Path) -> None:
    with Plant(folder) as plant:
        use_plant(folder, plant)
        text = (folder / "run.yaml").read_text()
        (folder / "run.yaml").write_text(text.replace("stage:\n", "stage:\n  axis: rotary\n"))
        refused(*arguments("identify"), at=folder, says=[plant.port, "axis is linear, the stage's is rotary"])
        assert plant.stop()["zeroings"] == []  # it was never armed


@pytest.mark.parametrize("force", [pytest.param(False, marks=pytest.mark.slow), True])
@COMMANDS
def test_a_plant_that_dies_while_running(folder: Path, command: str, force: bool) -> None:
    out = "results" if force else "new"
    given = [word for word in arguments(command) if force or word != "--force"]
    given[given.index("results")] = out
    name = "recording.h5" if command == "identify" else "without.h5"
    before = listing(folder / "results")
    with Plant(folder) as plant:
        use_plant(folder, plant)
        with Running(*given, at=folder) as run:
            work = f"results.new-{run.process.pid}" if force else "new"
            run.wait_for_rows(f"{work}/{name}", 300)
            plant.process.send_signal(signal.SIGKILL)
            ended = run.end()
    kept = folder / f"{out}.failed" / name
    one_error_line(ended, [plant.port, "has gone", f"kept in {out}.failed"])
    with h5py.File(kept, "r") as file:
        time = file["time"][:]
        assert len(time) >= 300 and np.all(np.diff(time) > 0)
        assert len(file["position"]) == len(file["voltage"]) == len(time)
        assert np.isfinite(file["position"][:]).all()
    assert listing(folder / "results") == before
    assert {p.name for p in folder.iterdir()} == {
        "results", f"{out}.failed", "model.yaml", "run.yaml", "plant.yaml",
    }  # fmt: skip


CAN = {
    "odrive-can": "lead: 1.0e-3, check_watchdog: false, heartbeat_timeout: 10.0",
    "cia402": "node: 5",
}


@pytest.mark.parametrize("drive", CAN)
def test_an_adapter_that_is_unplugged_while_running(folder: Path, drive: str) -> None:
    patience = "connect_timeout: 10.0, watchdog: 10.0, max_missed: 20000"
    before = listing(folder / "results")
    own = ["--watchdog", "10"] if drive == "odrive-can" else []  # of a CiA 402 drive the host sets it
    with Plant(folder, None, "--link", drive, *own) as plant:
        device = f"{{driver: {drive}, interface: slcan, channel: {plant.port}, {CAN[drive]}, {patience}}}"
        (folder / "run.yaml").write_text(configuration(device))
        with Running(*arguments("identify"), at=folder) as run:
            run.wait_for_rows(f"results.new-{run.process.pid}/recording.h5", 300)
            plant.process.send_signal(signal.SIGKILL)
            ended = run.end()
    one_error_line(ended, [plant.port, "has gone", "kept in results.failed"])
    assert listing(folder / "results") == before
    with h5py.File(folder / "results.failed" / "recording.h5", "r") as file:
        assert len(file["time"]) == len(file["position"]) >= 300


@pytest.mark.parametrize("drive", CAN)
def test_an_adapter_that_another_program_has(folder: Path, drive: str) -> None:
    with terminal() as port:
        device = f"{{driver: {drive}, interface: slcan, channel: {port}, {CAN[drive]}}}"
        (folder / "run.yaml").write_text(configuration(device))
        with held(port):
            refused(*arguments("identify"), at=folder, says=[port, "busy"])


@pytest.mark.parametrize("drive", CAN)
def test_a_port_that_is_no_can_adapter(folder: Path, drive: str) -> None:
    """A serial device of another kind, that says nothing or something else."""
    for answer in (lambda _: b"", lambda _: b"login: \r\n", lambda heard: heard):
        with terminal(answer) as port:
            quick = "connect_timeout: 0.5"
            device = f"{{driver: {drive}, interface: slcan, channel: {port}, {CAN[drive]}, {quick}}}"
            (folder / "run.yaml").write_text(configuration(device))
            refused(*arguments("identify"), at=folder, says=[port, "is it an slcan adapter?"])
