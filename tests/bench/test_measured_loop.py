"""The lateness of wake-ups as a recording tells it, and the runners that it is compared with."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.bench import loop, plain
from rtcomp.bench.busy import busy_cores, other_cores
from rtcomp.bench.spread import Spread
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped

PERIOD_US = 100.0


@given(st.lists(st.tuples(st.integers(0, 4), st.floats(0.0, 0.9)), min_size=1, max_size=50))
def test_wake_ups_come_back_from_rows_of_ticks_and_lost_slots(late):
    """Written as the loop writes them: a row for each lost slot, then the tick's with what is left."""
    lateness, overrun = [], []
    for slots, part in late:
        whole = PERIOD_US * (slots + part)
        lateness += [whole] * slots + [whole - slots * PERIOD_US]
        overrun += [2.0] * slots + [float(slots > 0 or part > 0.1)]
    woken = loop.wake_ups(np.array(lateness), overrun)
    assert woken == pytest.approx([PERIOD_US * (slots + part) for slots, part in late])
    assert Spread.of(woken).missed(PERIOD_US) == overrun.count(2.0)


def test_a_recording_that_ends_in_lost_slots_has_no_wake_up_for_them():
    assert loop.wake_ups(np.array([1.0, 250.0, 250.0]), [0.0, 2.0, 2.0]).tolist() == [1.0]


def test_the_plain_loop_skips_slots_that_have_passed(monkeypatch):
    """On a clock of its own: the third wake-up is 2.5 periods late, the fourth on time again."""
    now = [0.0]
    overslept = iter([0.0, 0.1e-3, 2.5e-3, 0.0, 0.2e-3])

    def sleep(seconds):
        now[0] += seconds + next(overslept)

    monkeypatch.setattr(plain.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(plain.time, "sleep", sleep)
    late = plain.loop(1000.0, 5)
    assert list(late) == pytest.approx([0.0, 100.0, 2500.0, 0.0, 200.0], abs=1e-6)


def test_the_plain_loop_in_its_own_process():
    late = plain.measure(500.0, 0.1)
    assert len(late) == 50 and min(late) >= 0.0


def test_the_plain_loop_imports_nothing_of_ours():
    code = "import sys, rtcomp.bench.plain; print([m for m in sys.modules if m.startswith('rtcomp.')])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said == "['rtcomp.bench', 'rtcomp.bench.plain']\n"


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_busy_processes_work_and_end(monkeypatch):
    started = []

    class Noted(subprocess.Popen):
        def __init__(self, *arguments, **settings):
            super().__init__(*arguments, **settings)
            started.append(self.pid)

    monkeypatch.setattr("rtcomp.bench.busy.subprocess.Popen", Noted)
    with busy_cores(2) as count:
        assert count == len(started) == 2 and all(map(alive, started))
        end = time.monotonic() + 60.0
        while time.monotonic() < end and not all(map(worked, started)):
            time.sleep(0.05)
        assert all(map(worked, started))
    assert not any(map(alive, started))
    assert other_cores() >= 1


def worked(pid):
    """Whether it had processor time."""
    return int(Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[11]) > 10


def test_the_loop_beside_its_rivals_at_the_shortest():
    said = []
    config = Configuration.load(shipped("leuven.yaml"))
    at = loop.measure(
        config, 500.0, 0.4, priority=10, stretch=0.2, progress=lambda p, who: said.append((p, who))
    )
    names = list(at.runners)
    assert names[0] == "loop" and names[-1] == "plain Python"
    assert len(said) == 2 * len(names) and [p for p, _ in said] == sorted(p for p, _ in said)
    for name, measured in at.runners.items():
        # The loop has 200 slots, of which some may pass; the others go on until they have woken up 200 times.
        assert 0 < measured.spread.total <= 200 and (name == "loop" or measured.spread.total == 200)
    told = at.to_json()
    assert set(told["ratios"]) == set(names) - {"loop"}
    for rival, ratios in told["ratios"].items():
        theirs, ours = told["runners"][rival], told["runners"]["loop"]
        assert ratios["p99"] is None or ratios["p99"] == pytest.approx(ours["p99_us"] / theirs["p99_us"])
    assert told["realtime"]["scheduling_class"] in ("SCHED_FIFO", "SCHED_OTHER")
    if told["realtime"]["scheduling_class"] == "SCHED_FIFO":
        assert told["realtime"]["priority"] == "10"
    assert told["execution"]["p50_us"] > 0.0
