"""A process prepared for deadlines says what it got, and is afterwards what it was before."""

from __future__ import annotations

import gc
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from rtcomp.loop.realtime import in_force, realtime_process


def locked_kb():
    return int(re.search(r"VmLck:\s+(\d+) kB", Path("/proc/self/status").read_text()).group(1))


def everything():
    return (
        os.sched_getscheduler(0),
        os.sched_getparam(0).sched_priority,
        gc.isenabled(),
        gc.get_freeze_count(),
    )


pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads /proc")


def test_everything_is_put_back():
    before, locked = everything(), locked_kb()
    with realtime_process() as found:
        assert not gc.isenabled()
        assert found == in_force() and found["garbage_collector"] == "off"
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
    assert in_force()["scheduling_class"] == "SCHED_OTHER" and in_force()["garbage_collector"] == "on"


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
        "from rtcomp.loop.realtime import realtime_process\n"
        "resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))\n"
        "resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))\n"
        "if os.getuid() == 0:\n"
        "    os.setgid(65534)\n"
        "    os.setuid(65534)\n"
        "with realtime_process() as found:\n"
        "    print(found['scheduling_class'], found['locked_memory'])\n"
        "print('done')\n"
    )
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert said.stdout == "SCHED_OTHER 0 kB\ndone\n", said.stderr
