"""Where the reading of the sensor may have jumped: single steps unlike those before and after."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rtcomp.kernels import Floats

MOST = 4
"""Jumps that are told, the clearest."""
OUTSTANDING = 5.0
"""Size of a jump in standard deviations of how steps differ from their neighbours, there and in general."""
AROUND, ITSELF = 25, 3
"""Rows before and after that say how steps differ there, and those that the jump itself changes."""


class Jump(NamedTuple):
    """A step between two rows: its time (s), size (m), and how many times it stands out."""

    time: float
    size: float
    clear: float


def jumps(time: Floats, position: Floats) -> list[Jump]:
    """Return the steps between rows that stand out most, the clearest first.

    A step is compared with the cubic through the two before and the two after it, which follows what the
    motion itself does; where it does so badly (contacts, stops) many steps differ, and none stands out.
    The time is half a row before the first reading after the jump.
    """
    step = np.diff(position)
    if step.size < 2 * AROUND:
        return []
    between = (4.0 * (step[1:-3] + step[3:-1]) - step[:-4] - step[4:]) / 6.0
    off = step[2:-2] - between
    size = np.abs(off)
    general = float(np.median(size)) / 0.6745
    others = _sum_around(off**2, AROUND) - _sum_around(off**2, ITSELF)
    there = np.sqrt(np.maximum(others, 0.0) / (2 * (AROUND - ITSELF)))
    clear = size / np.maximum(np.maximum(there, general), 1e-300)
    found: list[Jump] = []
    for _ in range(MOST):
        at = int(np.argmax(clear))
        if clear[at] <= OUTSTANDING:
            break
        most = float(clear[at])
        # The steps beside a jump stand out as well, by two thirds of it.
        begin = max(at - ITSELF, 0)
        at = begin + int(np.argmax(size[begin : at + ITSELF + 1]))
        found.append(Jump(float(0.5 * (time[at + 2] + time[at + 3])), float(off[at]), most))
        clear[max(at - 20, 0) : at + 21] = 0.0
    return found


def _sum_around(values: Floats, rows: int) -> Floats:
    """Return the sum over `rows` before each value, itself, and as many after; fewer at the ends."""
    return np.convolve(values, np.ones(2 * rows + 1), mode="same")
