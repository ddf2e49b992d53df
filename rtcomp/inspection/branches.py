"""The branches of a hysteresis: what lies between two reversals, seen from the first of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from rtcomp.kernels import Floats, compiled

FREE = 0.8
"""Part of a branch, up to the place where memory of the past may show, that is compared: near that place a
hysteresis without exact memory leaves the branch too early."""
DWELL = 0.2
"""A stop at a reversal longer than this part of the branch is left out of it."""


@dataclass(frozen=True)
class Branch:
    """One way between reversals, from its turning point on; a falling one mirrored at that point.

    travel: (K,), m, from 0, increasing. gained: (K,), N, force since the turning point, times -1 on a falling
    branch, so that both directions of a symmetric hysteresis are one curve.
    """

    rising: bool
    time: float
    """s, at which it leaves its turning point."""
    position: float
    """m, of the turning point."""
    force: float
    """N, at the turning point."""
    travel: Floats
    gained: Floats
    free: float
    """m, travel up to which nothing of what was before its turning point can show."""
    speed: float
    """m/s, mean over the rows that go further."""
    whole: bool
    """Whether it ends at a reversal, not with the recording."""
    rows: tuple[int, int]
    """First and last row, of the recording."""

    @property
    def sign(self) -> float:
        """1 where it rises, -1 where it falls."""
        return 1.0 if self.rising else -1.0

    @property
    def length(self) -> float:
        """Its travel, m."""
        return float(self.travel[-1])

    @property
    def end(self) -> float:
        """Where it ends, m."""
        return self.position + self.sign * self.length

    def at(self, travel: Floats) -> Floats:
        """Return the force gained (N) at a travel (m), straight between rows."""
        return np.asarray(np.interp(travel, self.travel, self.gained))

    def forces(self) -> Floats:
        """Return the force along it (N, (K,)), as measured."""
        return self.force + self.sign * self.gained


def turning_points(position: Floats, least: float) -> npt.NDArray[np.intp]:
    """Return the rows at which a motion (m, (K,)) turns back by more than `least` (m), in order.

    Each is the furthest row of its way, the first where several are as far; smaller motions there and back
    are none. The first and last row are not among them. Highest and lowest take turns.
    """
    rows = np.empty(position.size, dtype=np.int64)
    count = _turns(np.ascontiguousarray(position, dtype=np.float64), least, rows)
    return rows[:count].astype(np.intp)


@compiled
def _turns(x: Floats, least: float, rows: np.ndarray) -> int:
    count = 0
    low, high, way = 0, 0, 0
    for k in range(x.size):
        if way >= 0 and x[k] > x[high]:
            high = k
        if way <= 0 and x[k] < x[low]:
            low = k
        if way == 0:
            # The first way is known when it is long enough; where it began is no reversal.
            if x[high] - x[low] > least:
                way = 1 if high > low else -1
        elif way > 0 and x[high] - x[k] > least:
            rows[count] = high
            count += 1
            way, low = -1, k
        elif way < 0 and x[k] - x[low] > least:
            rows[count] = low
            count += 1
            way, high = 1, k
    return count


def branches(time: Floats, position: Floats, force: Floats, least: float, grain: float = 0.0) -> list[Branch]:
    """Cut a motion into its branches; all arrays (K,), s, m, N; reversals of at most `least` (m) are none.

    What precedes the first turning point is left out: what was before is not known there. `grain` (m) is what
    the sensor does not see: rest is motion within it. A branch is free of the past, that is the same whatever
    was before, until it has gone back over the branch before it (wiping-out), where a minor loop closes.
    """
    turns = turning_points(position, least)
    if turns.size == 0:
        return []
    rising = bool(position[turns[0]] < position[0])
    ways = [
        *pairwise(turns.tolist()),
        (turns[-1], _last(position, int(turns[-1]), rising, turns.size)),
    ]
    found: list[Branch] = []
    before = abs(float(position[turns[0]] - position[0]))
    for number, (first, last) in enumerate(ways):
        up = rising == (number % 2 == 0)
        one = _branch(
            time, position, force, int(first), int(last), up, before, grain, number < turns.size - 1
        )
        if one is not None:
            found.append(one)
        before = abs(float(position[last] - position[first]))
    return found


def _last(position: Floats, turn: int, first_rising: bool, count: int) -> int:
    """Return the furthest row after the last turning point."""
    rest = position[turn:]
    return turn + int(np.argmax(rest) if first_rising == (count % 2 == 1) else np.argmin(rest))


def _branch(
    time: Floats, position: Floats, force: Floats, first: int, last: int, rising: bool, before: float,
    grain: float, whole: bool,
) -> Branch | None:  # fmt: skip
    sign = 1.0 if rising else -1.0
    way = sign * (position[first : last + 1] - position[first])
    near = np.flatnonzero(way <= grain)
    start = int(near[-1]) if near.size and near[-1] > DWELL * (last - first) else 0
    way = way[start:] - way[start]
    # Small motions back are noise: only rows further than all before them count.
    further = np.concatenate([[True], way[1:] > np.maximum.accumulate(way)[:-1]])
    travel = way[further]
    if travel.size < 2:
        return None
    begin = first + start
    gained = sign * (force[begin : last + 1][further] - force[begin])
    # Without the time that small motions, minor loops among them, took.
    took = float(time[last] - time[begin]) * (travel.size - 1) / (last - begin)
    return Branch(
        rising, float(time[begin]), float(position[begin]), float(force[begin]), travel, gained,
        min(float(travel[-1]), before), float(travel[-1]) / took if took > 0.0 else 0.0, whole, (begin, last),
    )  # fmt: skip


def on_grid(some: Sequence[Branch], travel: Floats) -> Floats:
    """Return the force gained (N) of several branches at common travels (m, (G,)), a row each."""
    return np.array([one.at(travel) for one in some]).reshape(len(some), travel.size)
