"""Processes that keep the other cores busy while something is measured, as a desktop or a logger would."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator

_WORK = (
    "import os\n"
    "parent = os.getppid()\n"
    "while os.getppid() == parent:\n"  # it dies with whoever started it, however that ends
    "    sorted([(i * 7919) % 100003 for i in range(20000)])\n"
)


@contextlib.contextmanager
def busy_cores(count: int) -> Iterator[int]:
    """Keep `count` processes of ordinary priority busy, computing and touching memory; yield how many."""
    workers = [
        subprocess.Popen([sys.executable, "-S", "-c", _WORK], stdin=subprocess.DEVNULL) for _ in range(count)
    ]
    try:
        yield count
    finally:
        for worker in workers:
            worker.kill()
            worker.wait()


def other_cores() -> int:
    """Return how many cores this process may run on beside one for the loop, at least 1."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, usable - 1)
