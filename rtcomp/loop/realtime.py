"""Prepare this process for deadlines, put everything back afterwards, and say what was really in force."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import socket
from collections.abc import Collection, Iterator
from pathlib import Path

PRIORITY = 80
"""Of SCHED_FIFO, 1 to 99: above the kernel's interrupt threads (50), below its watchdogs (99)."""
ISOLATED = Path("/sys/devices/system/cpu/isolated")
_MCL_CURRENT, _MCL_FUTURE = 1, 2
_SET_TIMER_SLACK, _GET_TIMER_SLACK = 29, 30
_IDLE = Path("/dev/cpu_dma_latency")
_CLOCK = Path("/sys/devices/system/clocksource/clocksource0/current_clocksource")
_UNKNOWN = "unknown"


@contextlib.contextmanager
def realtime_process(priority: int = PRIORITY) -> Iterator[dict[str, str]]:
    """Ask for all that deadlines hang on and that a process can ask for; put it back on the way out.

    SCHED_FIFO of `priority`, not inherited by children; where that is refused, timers without slack; a core
    of its own (`cores_to_take`) that no other loop of this machine has taken; locked memory; processors that
    do not fall into deep sleep; no garbage collection.

    Nothing of it is required: the yielded dictionary says what the system granted, read back (`in_force`), so
    that it can be recorded.
    """
    with contextlib.ExitStack() as stack:
        stack.enter_context(_no_collection())
        stack.enter_context(_awake())
        stack.enter_context(_on_core_of_its_own())
        stack.enter_context(_scheduled(priority))
        stack.enter_context(_locked_memory())
        yield in_force()


def cores_to_take(isolated: str, allowed: Collection[int]) -> list[int]:
    """Return the cores to pin a loop to, best first.

    Those that the machine keeps for such (`isolated`, the kernel's list: ``2-3,6``), last first. Where it
    keeps none, those that this process may run on but for the first, where interrupts mostly go: none at all
    for one that may run on a single core, as ``taskset`` may have said.
    """
    ends = [part.split("-") for part in isolated.split(",") if part]
    kept = {core for end in ends for core in range(int(end[0]), int(end[-1]) + 1)}
    return sorted(kept or sorted(allowed)[1:], reverse=True)


@contextlib.contextmanager
def _no_collection() -> Iterator[None]:
    collecting = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()
        gc.unfreeze()


@contextlib.contextmanager
def _awake() -> Iterator[None]:
    """Hold open the request that waking up a processor takes no time, as cyclictest does."""
    descriptor = -1
    with contextlib.suppress(OSError):
        descriptor = os.open(_IDLE, os.O_WRONLY | os.O_CLOEXEC)
        os.write(descriptor, (0).to_bytes(4, "little"))
    try:
        yield
    finally:
        if descriptor >= 0:
            os.close(descriptor)


@contextlib.contextmanager
def _on_core_of_its_own() -> Iterator[None]:
    """Pin the process: one that is moved between cores leaves its cache behind, and is late for it.

    Two loops of one priority on one core would wait for each other. A core is taken by a socket's name, which
    the kernel gives back when the process ends, however it does.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    with contextlib.ExitStack() as stack:
        for core in cores_to_take(_text(ISOLATED), before):
            taken = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
            with contextlib.suppress(OSError):  # another loop's, or not this container's to give
                taken.bind(f"\0rtcomp-loop-on-core-{core}")
                os.sched_setaffinity(0, {core})
                break
        try:
            yield
        finally:
            os.sched_setaffinity(0, before)


@contextlib.contextmanager
def _scheduled(priority: int) -> Iterator[None]:
    before, slack = _scheduling(), timer_slack_ns()
    if before is None:
        yield
        return
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except PermissionError:
        if slack is not None:
            ctypes.CDLL(None).prctl(_SET_TIMER_SLACK, ctypes.c_ulong(1), 0, 0, 0)
    try:
        yield
    finally:
        with contextlib.suppress(PermissionError):
            os.sched_setscheduler(0, before[0], os.sched_param(before[1]))
        if slack:  # 0 is what real-time classes have, and would here mean the default
            ctypes.CDLL(None).prctl(_SET_TIMER_SLACK, ctypes.c_ulong(slack), 0, 0, 0)


@contextlib.contextmanager
def _locked_memory() -> Iterator[None]:
    locked = ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT | _MCL_FUTURE) == 0
    try:
        yield
    finally:
        if locked:
            ctypes.CDLL(None).munlockall()


def timer_slack_ns() -> int | None:
    """Return how much late (ns) the kernel may end sleeps of this thread; None where it does not tell."""
    try:
        slack = int(ctypes.CDLL(None).prctl(_GET_TIMER_SLACK, 0, 0, 0, 0))
    except (AttributeError, OSError):
        return None
    return slack if slack >= 0 else None


def in_force() -> dict[str, str]:
    """Return what of this process and machine deadlines hang on, read back from the system, as short texts.

    Scheduling class and priority, cores that it may run on, locked and resident memory, timer slack, the
    latency (us) that processors may take to wake up, clock source, collector; ``unknown`` where the system
    does not tell.
    """
    names = {
        getattr(os, n): n for n in ("SCHED_OTHER", "SCHED_FIFO", "SCHED_RR", "SCHED_BATCH") if hasattr(os, n)
    }
    found = _scheduling()
    policy = _UNKNOWN
    if found is not None:
        number = found[0] & ~getattr(os, "SCHED_RESET_ON_FORK", 0)
        policy = names.get(number, str(number))
    status = dict(line.split(":", 1) for line in _text(Path("/proc/self/status")).splitlines() if ":" in line)
    slack = timer_slack_ns()
    return {
        "scheduling_class": policy,
        "priority": str(found[1]) if found else _UNKNOWN,
        "cores": status.get("Cpus_allowed_list", _UNKNOWN).strip(),
        "locked_memory": status.get("VmLck", _UNKNOWN).strip(),
        "resident_memory": status.get("VmRSS", _UNKNOWN).strip(),
        "timer_slack": f"{slack} ns" if slack is not None else _UNKNOWN,
        "wake_up_latency": _wake_up_latency(),
        "clock_source": _text(_CLOCK) or _UNKNOWN,
        "garbage_collector": "on" if gc.isenabled() else "off",
    }


def _scheduling() -> tuple[int, int] | None:
    if not hasattr(os, "sched_getscheduler"):
        return None
    return os.sched_getscheduler(0), os.sched_getparam(0).sched_priority


def _wake_up_latency() -> str:
    try:
        data = _IDLE.read_bytes()
    except OSError:
        return _UNKNOWN
    return f"{int.from_bytes(data[:4], 'little')} us" if len(data) >= 4 else _UNKNOWN


def _text(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""
