"""`cyclictest` of Debian's rt-tests, the field's own measure of lateness: C, one thread that only sleeps."""

from __future__ import annotations

import re
import shutil
import subprocess

from rtcomp.bench.spread import Spread
from rtcomp.errors import RtcompError

LONGEST_US = 200_000
"""The histogram's last microsecond; what is later is known to be that late, and the latest exactly."""


def available() -> str | None:
    """Return the program's path; None where it is not installed (``apt install rt-tests``)."""
    return shutil.which("cyclictest")


def measure(program: str, rate_hz: float, seconds: float, priority: int, core: int | None = None) -> Spread:
    """Return the lateness of `seconds` of cycles of `program`, memory locked, at `rate_hz` and `priority`.

    With `core` it is pinned to that. Raises RtcompError where it ends otherwise than well, as it does
    without the right to SCHED_FIFO.
    """
    command = [
        program, "--quiet", "--mlockall", "--threads=1", f"--priority={priority}",
        f"--interval={round(1e6 / rate_hz)}", f"--loops={max(1, round(rate_hz * seconds))}",
        f"--histogram={LONGEST_US}",
        *([] if core is None else [f"--affinity={core}"]),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise RtcompError(
            f"cyclictest: ended with status {done.returncode}: {said[-1] if said else 'no reason given'}"
        )
    return parse(done.stdout)


def parse(text: str) -> Spread:
    """Return the spread in what ``cyclictest --histogram`` prints for one thread.

    Raises RtcompError where that is no such histogram, or its sum is not the total that it states.
    """
    seen = {float(us): int(count) for us, count in re.findall(r"^(\d+)\s+(\d+)$", text, re.MULTILINE)}
    stated = {
        name: int(number) for name, number in re.findall(r"^# ([A-Z][A-Za-z ]+): (\d+)$", text, re.MULTILINE)
    }
    if not seen or "Total" not in stated:
        raise RtcompError("cyclictest: its output holds no histogram; rt-tests 1.0 or newer is needed")
    inside = sum(seen.values())
    beyond = stated.get("Histogram Overflows", 0)
    if inside != stated["Total"]:
        raise RtcompError(
            f"cyclictest: its histogram holds {inside} cycles, its total says {stated['Total']}"
        )
    if beyond:
        seen[max(seen)] += beyond - 1
        latest = float(stated["Max Latencies"])
        seen[latest] = seen.get(latest, 0) + 1
    return Spread.counted(seen)
