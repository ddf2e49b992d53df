"""A process prepared for deadlines says what it got, and is afterwards what it was before."""

from __future__ import annotations

import gc
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.loop import realtime
from rtcomp.loop.realtime import cores_to_take, in_force, realtime_process, timer_slack_ns


def locked_kb():
    return int(re.search(r"VmLck:\s+(\d+) kB", Path("/proc/self/status").read_text()).group(1))


def everything():
    return (
        os.sched_getscheduler(0),
        os.sched_getparam(0).sched_priority,
        os.sched_getaffinity(0),
        timer_slack_ns(),
        gc.isenabled(),
        gc.get_freeze_count(),
    )


pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads /proc")


def test_everything_is_put_back():
    before, locked = everything(), locked_kb()
    with realtime_process() as found:
        assert not gc.isenabled()
        now = in_force() | {"resident_memory": found["resident_memory"]}  # grows with every word said
        assert found == now and found["garbage_collector"] == "off"
    assert everything() == before and locked_kb() == locked


def test_everything_is_put_back_after_an_error():
    before, locked = everything(), locked_kb()
    with pytest.raises(ZeroDivisionError), realtime_process():
        raise ZeroDivisionError
    assert everything() == before and locked_kb() == locked


def test_a_collector_that_was_off_stays_off():
    gc.disable()
    try:
        with realtime_process():
            assert not gc.isenabled()
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_what_is_said_is_what_the_system_says():
    with realtime_process(priority=7) as found:
        policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
        granted = policy == os.SCHED_FIFO
        assert found["scheduling_class"] == ("SCHED_FIFO" if granted else "SCHED_OTHER")
        assert found["priority"] == str(os.sched_getparam(0).sched_priority) == ("7" if granted else "0")
        assert found["locked_memory"] == f"{locked_kb()} kB"
        assert found["timer_slack"] == ("0 ns" if granted else "1 ns")
        assert found["wake_up_latency"] in ("0 us", "unknown")
        assert cores(found["cores"]) == os.sched_getaffinity(0)
        assert (locked_kb() > 0) == (found["locked_memory"] != "0 kB")
    assert in_force()["scheduling_class"] == "SCHED_OTHER" and in_force()["garbage_collector"] == "on"


def cores(listed):
    """The kernel's lists: 0-2,5."""
    ends = [part.split("-") for part in listed.split(",")]
    return {core for end in ends for core in range(int(end[0]), int(end[-1]) + 1)}


def test_every_text_fits_its_place_in_a_recording():
    from rtcomp.recording.file import TEXT_BYTES

    with realtime_process() as found:
        assert all(0 < len(text.encode()) <= TEXT_BYTES for text in found.values())


def as_the_kernel_writes(numbers):
    """Neighbours joined: 0-2,5."""
    runs = []
    for number in sorted(numbers):
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ",".join(f"{a}-{b}" if b > a else f"{a}" for a, b in runs)


@given(st.sets(st.integers(0, 200), min_size=1), st.sets(st.integers(0, 200), min_size=1))
def test_isolated_cores_are_taken_last_first(isolated, allowed):
    assert cores_to_take(as_the_kernel_writes(isolated), allowed) == sorted(isolated, reverse=True)


@given(st.sets(st.integers(0, 200), min_size=1))
def test_without_isolated_cores_the_first_is_left_to_others(allowed):
    assert cores_to_take("", allowed) == sorted(allowed - {min(allowed)}, reverse=True)


def told(cores, tmp_path, monkeypatch):
    """A machine that keeps these cores for loops."""
    file = tmp_path / "isolated"
    file.write_text(f"{cores}\n")
    monkeypatch.setattr(realtime, "ISOLATED", file)


def test_a_core_of_its_own_is_the_only_one_while_it_lasts(tmp_path, monkeypatch):
    before = os.sched_getaffinity(0)
    told(max(before), tmp_path, monkeypatch)
    for _ in range(2):  # it is given back
        with realtime_process() as found:
            assert os.sched_getaffinity(0) == {max(before)} and found["cores"] == str(max(before))
        assert os.sched_getaffinity(0) == before


def test_a_core_that_is_not_there_is_not_taken(tmp_path, monkeypatch):
    before = os.sched_getaffinity(0)
    told("4095", tmp_path, monkeypatch)
    with realtime_process():
        assert os.sched_getaffinity(0) == before


def test_no_two_loops_share_a_core_of_their_own(tmp_path, monkeypatch):
    """The other has it until it is killed."""
    before = os.sched_getaffinity(0)
    told(max(before), tmp_path, monkeypatch)
    script = (
        "import sys, time\n"
        "from pathlib import Path\n"
        "from rtcomp.loop import realtime\n"
        f"realtime.ISOLATED = Path({str(realtime.ISOLATED)!r})\n"
        "with realtime.realtime_process() as found:\n"
        "    print(found['cores'], flush=True)\n"
        "    time.sleep(60)\n"
    )
    other = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    try:
        assert other.stdout.readline() == f"{max(before)}\n"
        with realtime_process() as found:
            assert os.sched_getaffinity(0) == before and cores(found["cores"]) == before
    finally:
        other.kill()
        other.communicate()
    with realtime_process():
        assert os.sched_getaffinity(0) == {max(before)}


def test_children_do_not_inherit_the_class():
    """A recorder started from inside the loop must not compete with it."""
    with realtime_process():
        ask = "import os; print(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER)"
        said = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True).stdout
    assert said == "True\n"


def test_without_the_privilege_it_goes_on_without():
    """In a process that may neither take the class nor lock memory: nothing fails, and it says so."""
    if os.getuid() != 0 and in_force()["scheduling_class"] != "SCHED_OTHER":
        pytest.skip("already in another class")
    script = (
        "import os, resource\n"
        "from rtcomp.loop.realtime import in_force, realtime_process\n"
        "resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))\n"
        "resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))\n"
        "if os.getuid() == 0:\n"
        "    os.setgid(65534)\n"
        "    os.setuid(65534)\n"
        "with realtime_process() as found:\n"
        "    print(found['scheduling_class'], found['locked_memory'], found['timer_slack'])\n"
        "print(in_force()['timer_slack'])\n"
    )
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    before = in_force()["timer_slack"]
    assert said.stdout == f"SCHED_OTHER 0 kB 1 ns\n{before}\n", said.stderr
