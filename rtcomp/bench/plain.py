"""The plain rival: a loop as one writes it in Python on a Friday, sleeping until the next slot.

    python -m rtcomp.bench.plain RATE_HZ TICKS

runs it, with nothing asked of the system and nothing done in a tick, and writes each lateness (us) as native
float64 to standard output. It imports nothing of this project.
"""

from __future__ import annotations

import subprocess
import sys
import time
from array import array


def loop(rate_hz: float, ticks: int) -> array[float]:
    """Return the lateness (us) of each wake-up; a slot that has passed is skipped, as cyclictest does."""
    period = 1.0 / rate_hz
    late = array("d")
    due = time.perf_counter()
    while len(late) < ticks:
        due += period
        left = due - time.perf_counter()
        if left > 0.0:
            time.sleep(left)
        lateness = time.perf_counter() - due
        late.append(1e6 * lateness)
        due += int(lateness / period) * period
    return late


def measure(rate_hz: float, seconds: float) -> array[float]:
    """Return the lateness (us) of such a loop in a process of its own, `seconds` long."""
    command = [
        sys.executable,
        "-m",
        "rtcomp.bench.plain",
        repr(rate_hz),
        str(max(1, round(rate_hz * seconds))),
    ]
    done = subprocess.run(command, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, check=True)
    late = array("d")
    late.frombytes(done.stdout)
    return late


if __name__ == "__main__":
    sys.stdout.buffer.write(loop(float(sys.argv[1]), int(sys.argv[2])).tobytes())
