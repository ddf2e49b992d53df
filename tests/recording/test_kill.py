"""Whatever is killed at whatever moment: the recording opens everywhere and misses at most 100 ms."""

from __future__ import annotations

import os
import random
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from rtcomp.loop.ring import Ring

RATE = 1000.0
LOOP = Path(__file__).with_name("loop_process.py")
MISSING_MS = 100.0


class Victim:
    """A loop with its recorder, both to be killed; the ring is kept here to know what was written."""

    def __init__(self, path: Path, rows: int = 0) -> None:
        self.path = path
        self.ring = Ring.create(8192, 4 + 20)
        self.loop = subprocess.Popen(
            [sys.executable, str(LOOP), str(self.ring.descriptor), str(path), str(RATE), str(rows)],
            pass_fds=(self.ring.descriptor,), stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self.loop.stdout is not None
        self.recorder = int(self.loop.stdout.readline())
        self.recorder_watch = os.pidfd_open(self.recorder)

    def kill(self, what: str) -> int:
        """Kill `what` and return the rows that had been written by then."""
        pids = {"loop": [self.loop.pid], "recorder": [self.recorder], "both": [self.recorder, self.loop.pid]}
        written = self.ring.written
        for pid in pids[what]:
            os.kill(pid, signal.SIGKILL)
        if what != "recorder":
            self.loop.wait(10)
            written = self.ring.written if what == "loop" else written
        self.wait_for_recorder()
        return written

    def wait_for_recorder(self) -> None:
        assert select.select([self.recorder_watch], [], [], 10)[0], "the recorder did not end"

    def close(self) -> None:
        if self.loop.poll() is None:
            self.loop.kill()
            self.loop.wait(10)
        self.wait_for_recorder()
        os.close(self.recorder_watch)
        self.loop.stdout.close()  # type: ignore[union-attr]
        self.ring.release()


@pytest.fixture
def victims() -> Iterator[list[Victim]]:
    started: list[Victim] = []
    yield started
    for victim in started:
        victim.close()


def missing_ms(path: Path, written: int) -> float:
    """Check the file in every way it may be opened and return how much of what was written it has not."""
    counts = []
    for options in ({}, {"swmr": True}):
        with h5py.File(path, "r", **options) as file:
            columns = {name: file[name][:] for name in ("time", "position", "voltage", "row")}
            rows = min(len(column) for column in columns.values())
            # A kill within a flush (tens of microseconds) may leave columns one flush apart in length.
            assert max(len(column) for column in columns.values()) - rows <= MISSING_MS * RATE / 1e3
            assert np.array_equal(columns["row"][:rows], np.arange(rows))
            assert np.array_equal(columns["time"][:rows], np.arange(rows) / RATE)
            assert np.array_equal(columns["position"][:rows], 1e-6 * np.arange(rows))
            weights, at = file["weights/weights"][:], file["weights/time"][:]
            for time_s, row in zip(at, weights, strict=False):
                assert np.allclose(row, time_s * RATE)
            counts.append(rows)
    assert counts[0] == counts[1]
    return (written - counts[0]) / RATE * 1e3


def kill_at_random(victims: list[Victim], folder: Path, kills: list[str], longest_s: float) -> list[float]:
    chance = random.Random(int.from_bytes(os.urandom(4), "little"))
    missing = []
    for i, what in enumerate(kills):
        victim = Victim(folder / f"{i}.h5")
        victims.append(victim)
        time.sleep(chance.uniform(0.15, longest_s))
        written = victim.kill(what)
        missing.append(missing_ms(victim.path, written))
        victim.close()
        victims.remove(victim)
    return missing


def test_recording_survives_kills(tmp_path: Path, victims: list[Victim]) -> None:
    missing = kill_at_random(victims, tmp_path, ["loop", "recorder", "both", "both"], 0.6)
    assert missing[0] == 0.0  # what the loop wrote is in the ring, and the ring outlives it
    assert max(missing) <= MISSING_MS, missing


@pytest.mark.slow
@pytest.mark.realtime
@pytest.mark.parametrize("what", ["loop", "recorder", "both"])
def test_recording_survives_twenty_kills(tmp_path: Path, victims: list[Victim], what: str) -> None:
    missing = kill_at_random(victims, tmp_path, [what] * 20, 3.0)
    print(f"killed {what} 20 times: missing ms {min(missing):.0f} to {max(missing):.0f}")
    assert max(missing) <= (0.0 if what == "loop" else MISSING_MS), missing


def test_killed_loop_is_marked(tmp_path: Path, victims: list[Victim]) -> None:
    victim = Victim(tmp_path / "a.h5")
    victims.append(victim)
    time.sleep(0.2)
    written = victim.kill("loop")
    with h5py.File(victim.path) as file:
        assert file.attrs["complete"] == 0
        assert file.attrs["ended"] == b"loop died"
        assert file.attrs["rows_lost"] == 0
        assert len(file["row"]) == written


def test_killed_recorder_does_not_reach_the_loop(tmp_path: Path, victims: list[Victim]) -> None:
    victim = Victim(tmp_path / "a.h5", rows=600)
    victims.append(victim)
    time.sleep(0.2)
    victim.kill("recorder")
    said, _ = victim.loop.communicate(timeout=20)
    assert victim.loop.returncode == 0
    assert victim.ring.written == 600
    with h5py.File(victim.path) as file:
        rows = len(file["row"])
        assert file.attrs["complete"] == 0
    assert "recorder died" in said and "signal 9" in said and f"rows_lost={600 - rows}" in said


def test_signals_to_the_loops_group_leave_the_recorder(tmp_path: Path, victims: list[Victim]) -> None:
    victim = Victim(tmp_path / "a.h5")
    victims.append(victim)
    assert os.getsid(victim.recorder) == victim.recorder
    os.kill(victim.recorder, signal.SIGINT)
    time.sleep(0.2)
    assert victim.ring.waiting < 100
    os.kill(victim.recorder, signal.SIGTERM)  # this one it obeys, in good order
    victim.wait_for_recorder()
    with h5py.File(victim.path) as file:
        assert file.attrs["ended"] == b"recorder told to end"
        assert file.attrs["complete"] == 0
        assert len(file["row"]) > 100
