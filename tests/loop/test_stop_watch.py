"""The emergency stop's own process: a file that appears, and that it goes when the loop has gone."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rtcomp.loop.ring import STOPPED, Ring
from rtcomp.loop.stop_watch import stop_watch


@pytest.fixture()
def ring():
    made = Ring.create(16, 4)
    yield made
    made.release()


def children(pid: int) -> dict[str, bytes]:
    numbers = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return {n: command(n) for n in numbers}


def command(number: str) -> bytes:
    """The command line of a process; empty where it has gone, or is only waited for."""
    try:
        return Path(f"/proc/{number}/cmdline").read_bytes()
    except OSError:
        return b""


def wait(condition) -> None:
    end = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.001)


def test_a_file_that_appears_stops(ring, tmp_path):
    with stop_watch(ring, tmp_path / "STOP"):
        time.sleep(0.05)
        assert not ring.header[STOPPED]
        (tmp_path / "STOP").touch()
        wait(lambda: ring.header[STOPPED] == 2)
        (tmp_path / "STOP").unlink()
        time.sleep(0.02)
        assert ring.header[STOPPED] == 2  # latched: the file that goes away takes nothing back


def test_a_file_that_is_there_has_stopped_it_before_it_begins(ring, tmp_path):
    (tmp_path / "STOP").symlink_to("nowhere")  # a name is enough
    with stop_watch(ring, tmp_path / "STOP"):
        assert ring.header[STOPPED] == 2


def test_nothing_to_watch_starts_nothing(ring):
    with stop_watch(ring):
        assert not any(b"stop_process" in command for command in children(os.getpid()).values())


def test_without_a_terminal_keys_are_not_watched_and_nothing_fails(tmp_path):
    """In a session of its own, as under cron; and when the loop is killed, nobody stays behind."""
    script = (
        "import time\nfrom rtcomp.loop.ring import Ring\nfrom rtcomp.loop.stop_watch import stop_watch\n"
        "ring = Ring.create(16, 4)\n"
        "with stop_watch(ring, keys=True):\n"
        "    print('watched', flush=True); time.sleep(60)\n"
    )
    loop = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True,
        start_new_session=True,
    )  # fmt: skip
    assert loop.stdout.readline() == "watched\n"
    (watcher,) = children(loop.pid)
    assert b"stop_process" in command(watcher)
    loop.kill()
    loop.wait()
    wait(lambda: not command(watcher))
