"""Diagnoses in processes of their own: none is waited for without end, none outlives the trial."""

from __future__ import annotations

import os
import sys
import threading
import time
from pathlib import Path

import pytest

from rtcomp.interrupts import Stop
from rtcomp.trial.run import Processes, Task


def task(name: str, code: str, folder: Path, timeout_s: float = 30.0) -> Task:
    return Task(name, (sys.executable, "-c", code), folder / f"{name}.log", timeout_s)


def gone(pid: int) -> bool:
    """Whether no such process runs (one that ended and was not collected by init yet is gone, too)."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return True
    return state == "Z"


def test_outcomes_come_in_order_with_status_and_last_words(tmp_path: Path) -> None:
    with Processes(2, Stop()) as processes:
        slow, bad = processes.run(
            [
                task("slow", "import time; time.sleep(0.5); print('done')", tmp_path),
                task("bad", "import sys; print('half'); sys.exit('no motion')", tmp_path),
            ]
        )
        assert processes.running == 0
    assert slow.well and slow.words == "done" and slow.seconds >= 0.5
    assert not bad.well and bad.status == 1 and bad.words == "no motion"


def test_a_program_that_does_not_exist_is_a_finding(tmp_path: Path) -> None:
    with Processes(1, Stop()) as processes:
        (outcome,) = processes.run([Task("none", ("/no/such/program",), tmp_path / "log", 5.0)])
    assert outcome.status == 127 and "no such file" in outcome.words.lower()


FAMILY = (
    "import subprocess, sys, time, pathlib, os;"
    "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(300)']);"
    "pathlib.Path({path!r}).write_text(f'{{os.getpid()}} {{child.pid}}'); time.sleep({seconds})"
)


@pytest.mark.parametrize("seconds", [300.0, 0.0])
def test_what_a_diagnosis_started_ends_with_it(seconds: float, tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    code = FAMILY.format(path=str(pids), seconds=seconds)
    with Processes(1, Stop()) as processes:
        (outcome,) = processes.run([task("family", code, tmp_path, 3.0)])
    assert outcome.timed_out == (seconds > 0.0)
    assert_gone(pids)


def test_diagnoses_side_by_side_share_the_cores(tmp_path: Path) -> None:
    code = "import os; print(os.environ['NUMBA_NUM_THREADS'], os.environ['OMP_NUM_THREADS'])"
    cores = os.cpu_count() or 1
    for jobs in (1, cores, 2 * cores):
        with Processes(jobs, Stop()) as processes:
            (said,) = processes.run([task("says", code, tmp_path)])
        share = max(1, cores // jobs)
        assert said.words == f"{share} {share}"


def test_an_error_while_they_run_ends_them_all(tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    wait = f"import time, pathlib\nwhile not pathlib.Path({str(pids)!r}).exists(): time.sleep(0.01)"
    tasks = [
        task("first", wait, tmp_path),
        task("second", FAMILY.format(path=str(pids), seconds=300.0), tmp_path, 120.0),
        task("third", "print('never')", tmp_path),
    ]  # fmt: skip

    def stop(_: object) -> None:
        raise KeyboardInterrupt

    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt), Processes(2, Stop()) as processes:
        processes.run(tasks, stop)
    assert_gone(pids)
    assert threading.active_count() == before


def assert_gone(pids: Path) -> None:
    for pid in map(int, pids.read_text().split()):
        deadline = time.monotonic() + 5.0
        while not gone(pid) and time.monotonic() < deadline:
            time.sleep(0.01)
        assert gone(pid) and pid != os.getpid()
