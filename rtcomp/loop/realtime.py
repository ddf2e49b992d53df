"""Prepare this process for deadlines, put everything back afterwards, and say what was really in force."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
from collections.abc import Iterator
from pathlib import Path

PRIORITY = 80
_MCL_CURRENT, _MCL_FUTURE = 1, 2


@contextlib.contextmanager
def realtime_process(priority: int = PRIORITY) -> Iterator[dict[str, str]]:
    """Ask for SCHED_FIFO (not inherited by children), locked memory, and no garbage collection.

    Nothing of it is required: the yielded dictionary says what the system granted, read back, so that it
    can be recorded. Everything is put back on the way out, whatever happens.
    """
    before = _scheduling()
    locked = False
    collecting = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        if hasattr(os, "sched_setscheduler"):
            with contextlib.suppress(PermissionError):
                os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
            locked = _lock_memory()
        yield in_force()
    finally:
        if before is not None:
            with contextlib.suppress(PermissionError):
                os.sched_setscheduler(0, before[0], os.sched_param(before[1]))
        if locked:
            ctypes.CDLL(None).munlockall()
        if collecting:
            gc.enable()
        gc.unfreeze()


def _scheduling() -> tuple[int, int] | None:
    if not hasattr(os, "sched_getscheduler"):
        return None
    return os.sched_getscheduler(0), os.sched_getparam(0).sched_priority


def _lock_memory() -> bool:
    return bool(ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT | _MCL_FUTURE) == 0)


def in_force() -> dict[str, str]:
    """Return the scheduling class, priority, locked memory and collector of this process, read back."""
    names = {
        getattr(os, n): n for n in ("SCHED_OTHER", "SCHED_FIFO", "SCHED_RR", "SCHED_BATCH") if hasattr(os, n)
    }
    found = _scheduling()
    policy = (
        "unknown"
        if found is None
        else names.get(found[0] & ~getattr(os, "SCHED_RESET_ON_FORK", 0), str(found[0]))
    )
    status = Path("/proc/self/status")
    locked = "unknown"
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmLck:"):
                locked = line.split(":", 1)[1].strip()
    return {
        "scheduling_class": policy,
        "priority": str(found[1]) if found else "unknown",
        "locked_memory": locked,
        "garbage_collector": "on" if gc.isenabled() else "off",
    }
