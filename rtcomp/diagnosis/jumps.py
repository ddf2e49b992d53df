"""Where the reading of the sensor may have jumped: single steps unlike those before and after."""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats

MOST = 4
OUTSTANDING = 6.0
"""Size of a jump in robust standard deviations of how steps differ from their neighbours."""


def jumps(time: Floats, position: Floats) -> list[tuple[float, float]]:
    """Return times (s) and sizes (m) of the steps between rows that stand out most, the largest first.

    The time is half a row before the first reading after the jump.
    """
    step = np.diff(position)
    if step.size < 9:
        return []
    around = 0.25 * (step[:-4] + step[1:-3] + step[3:-1] + step[4:])
    off = step[2:-2] - around
    least = OUTSTANDING * float(np.median(np.abs(off))) / 0.6745
    size = np.abs(off)
    found: list[tuple[float, float]] = []
    for _ in range(MOST):
        at = int(np.argmax(size))
        if size[at] <= least:
            break
        found.append((float(0.5 * (time[at + 2] + time[at + 3])), float(off[at])))
        size[max(at - 20, 0) : at + 21] = 0.0
    return found
