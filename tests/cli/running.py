"""Commands and plants that run beside the test: started, watched, signalled, and what they leave."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from pathlib import Path
from typing import Any, Self

import h5py
from command import CONFIG, RTCOMP, environment

PATIENCE_S = 60.0
SERIAL = "device: {driver: simulated, delay_ticks: 0}"


def configuration(device: str | None = None, seconds: float = 30.0, judged: float = 30.0) -> str:
    """The configuration of these tests on the wall clock, lasting longer than any of them."""
    text = CONFIG.replace(SERIAL, f"device: {device}" if device else f"{SERIAL}\nclock: wall")
    learned, rest = text.split("\njudge:")
    learned = learned.replace("duration: 1.5", f"duration: {seconds}")
    return f"{learned}\njudge:{rest.replace('duration: 1.5', f'duration: {judged}')}"


def link(port: str) -> str:
    """The device section for a plant on a machine that may be busy with anything: it is waited for."""
    return f"{{driver: serial, port: {port}, connect_timeout: 10.0, watchdog: 10.0, max_missed: 20000}}"


class Running:
    """`rtcomp` with the given arguments in the folder `at`; ended when the context ends."""

    def __init__(self, *arguments: object, at: Path) -> None:
        self.at = at
        self.process = subprocess.Popen(
            [RTCOMP, *map(str, arguments)], cwd=at, env=environment(), text=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.communicate()

    def wait_for_rows(self, recording: str, rows: int) -> None:
        """Wait until the recording at this place has so many rows."""
        end = time.monotonic() + PATIENCE_S
        while rows_now(self.at / recording) < rows:
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < end, f"{recording} has only {rows_now(self.at / recording)} rows"
            time.sleep(0.05)

    def end(self) -> subprocess.CompletedProcess[str]:
        """Wait for its end and return what it said."""
        output, errors = self.process.communicate(timeout=PATIENCE_S)
        return subprocess.CompletedProcess([], self.process.returncode, output, errors)


class Plant(Running):
    """`rtcomp plant serve` of the configuration of these tests."""

    def __init__(self, folder: Path, config: Path | None = None, *more: object) -> None:
        if config is None:
            config = folder / "plant.yaml"
            config.write_text(CONFIG)
        super().__init__(
            "plant", "serve", "--config", config, "--json", "--log", "plant.json", *more, at=folder
        )
        assert self.process.stdout is not None
        self.port: str = json.loads(self.process.stdout.readline())["port"]

    def stop(self) -> dict[str, Any]:
        """End it in order; return its log."""
        self.process.send_signal(signal.SIGTERM)
        run = self.end()
        assert (run.returncode, run.stderr) == (0, "")
        log: dict[str, Any] = json.loads((self.at / "plant.json").read_text())
        return log


def rows_now(path: Path) -> int:
    """Rows that a recording being written has, 0 where it is not there yet."""
    try:
        with h5py.File(path, "r", libver="latest", swmr=True) as file:
            return len(file["time"])
    except (OSError, KeyError):
        return 0


def alive(pid: int) -> bool:
    """Whether a process of that number runs."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True
