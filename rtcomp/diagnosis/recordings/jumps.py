"""Where the reading of the sensor may have jumped: single steps unlike those before and after."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.recording.pieces import pieces, sample

MOST = 4
"""Jumps that are told, the clearest."""
OUTSTANDING = 5.0
"""Size of a jump in standard deviations of how steps differ from their neighbours, there and in general."""
AROUND, ITSELF = 25, 3
"""Rows before and after that say how steps differ there, and those that the jump itself changes."""
APART, BESIDE = 20, AROUND + 2 * ITSELF
"""Rows to another jump, at least, and those beside a piece of a long recording that are looked at with it."""


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
    if position.size < 2 * AROUND + 1:
        return []
    general = float(np.median(np.abs(np.concatenate([_off(part) for part in sample(position)])))) / 0.6745
    found: list[tuple[int, Jump]] = []
    for piece in pieces(position.size):
        begin = max(piece.start - BESIDE, 0)
        rows = slice(begin, piece.stop + BESIDE)
        near = _standing_out(time[rows], position[rows], general)
        found += [(begin + at, j) for at, j in near if piece.start <= begin + at < piece.stop]
    clearest: list[tuple[int, Jump]] = []
    for at, jump in sorted(found, key=lambda each: -each[1].clear):
        if all(abs(at - other) > APART for other, _ in clearest):
            clearest.append((at, jump))
    return [jump for _, jump in clearest[:MOST]]


def _off(position: Floats) -> Floats:
    """Return by how much steps between rows differ from the cubic through those beside them."""
    step = np.diff(position)
    return np.asarray(step[2:-2] - (4.0 * (step[1:-3] + step[3:-1]) - step[:-4] - step[4:]) / 6.0)


def _standing_out(time: Floats, position: Floats, general: float) -> list[tuple[int, Jump]]:
    """Return the steps that stand out most from those around and from the `general` difference, by row."""
    off = _off(position)
    size = np.abs(off)
    others = _sum_around(off**2, AROUND) - _sum_around(off**2, ITSELF)
    there = np.sqrt(np.maximum(others, 0.0) / (2 * (AROUND - ITSELF)))
    clear = size / np.maximum(np.maximum(there, general), 1e-300)
    found: list[tuple[int, Jump]] = []
    for _ in range(MOST):
        at = int(np.argmax(clear))
        if clear[at] <= OUTSTANDING:
            break
        most = float(clear[at])
        # The steps beside a jump stand out as well, by two thirds of it.
        begin = max(at - ITSELF, 0)
        at = begin + int(np.argmax(size[begin : at + ITSELF + 1]))
        found.append((at + 2, Jump(float(0.5 * (time[at + 2] + time[at + 3])), float(off[at]), most)))
        clear[max(at - APART, 0) : at + APART + 1] = 0.0
    return found


def _sum_around(values: Floats, rows: int) -> Floats:
    """Return the sum over `rows` before each value, itself, and as many after; fewer at the ends."""
    total, at = np.concatenate([[0.0], np.cumsum(values)]), np.arange(values.size)
    return np.asarray(total[np.minimum(at + rows + 1, values.size)] - total[np.maximum(at - rows, 0)])
