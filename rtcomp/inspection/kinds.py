"""Branches of one kind: the same way again, between the same turning points, from the same force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.inspection.branches import Branch

NEAR = 0.04
"""Turning points of one kind lie within this part of the stroke, or what the sensor sees;"""
LONG = 0.15
"""their lengths within this part of the length,"""
FORCE = 0.1
"""and their forces at the turning point within this part of the force range."""
THRICE, HALF, ALIKE = 3, 0.5, 0.9
"""See `major_loop`."""
EACH = 12
"""Repeats of a kind that are compared at most; they are taken evenly over the recording."""


@dataclass(frozen=True)
class Kind:
    """Repeats of one branch, in order of time."""

    repeats: tuple[Branch, ...]

    @property
    def rising(self) -> bool:
        """Direction of all of them."""
        return self.repeats[0].rising

    @property
    def position(self) -> float:
        """Mean position of their turning points, m."""
        return float(np.mean([b.position for b in self.repeats]))

    @property
    def force(self) -> float:
        """Mean force at their turning points, N."""
        return float(np.mean([b.force for b in self.repeats]))

    @property
    def length(self) -> float:
        """Travel that all of them have, m."""
        return min(b.length for b in self.repeats)

    @property
    def end(self) -> float:
        """Mean position at which they end, m."""
        return float(np.mean([b.end for b in self.repeats]))

    def some(self, most: int = EACH) -> list[Branch]:
        """Return up to `most` of the repeats, evenly over the recording."""
        count = len(self.repeats)
        return [
            self.repeats[i]
            for i in np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int))
        ]


def kinds_of(branches: Sequence[Branch], near: float, force_range: float) -> list[Kind]:
    """Sort whole branches into kinds; turning points `near` (m) each other are one.

    A branch belongs to the first kind whose first branch is as long and begins at as much force as LONG and
    FORCE say.
    """
    found: list[list[Branch]] = []
    founders = np.empty((0, 4))
    for one in branches:
        if not one.whole:
            continue
        mark = np.array([one.sign, one.position, one.length, one.force])
        alike = (
            (founders[:, 0] == mark[0])
            & (np.abs(founders[:, 1] - mark[1]) <= near)
            & (np.abs(founders[:, 2] - mark[2]) <= LONG * np.maximum(mark[2], founders[:, 2]))
            & (np.abs(founders[:, 3] - mark[3]) <= FORCE * force_range)
        )
        if alike.any():
            found[int(np.argmax(alike))].append(one)
        else:
            found.append([one])
            founders = np.vstack([founders, mark])
    return [Kind(tuple(some)) for some in found]


@dataclass(frozen=True)
class MajorLoop:
    """The largest loop that was travelled both ways between the same turning points."""

    rising: Kind
    falling: Kind

    @property
    def length(self) -> float:
        """Travel that all of its branches have, m."""
        return min(self.rising.length, self.falling.length)

    @property
    def repeats(self) -> int:
        """How often it was travelled in the rarer direction."""
        return min(len(self.rising.repeats), len(self.falling.repeats))

    @property
    def centre(self) -> float:
        """Middle between its turning points, m."""
        return 0.5 * (self.rising.position + self.falling.position)

    @property
    def forces(self) -> tuple[float, float]:
        """Lowest and highest force (N) on it, means of its repeats."""
        every = [(b.forces().min(), b.forces().max()) for k in (self.rising, self.falling) for b in k.repeats]
        low, high = np.mean(np.array(every), axis=0)
        return float(low), float(high)


def major_loop(kinds: Sequence[Kind], near: float) -> MajorLoop | None:
    """Return the largest loop that was repeated often enough to know its scatter.

    That is: of the loops travelled THRICE each way and longer than HALF of the longest of all, else of those
    travelled twice, else of all, the longest; of those within ALIKE of it the oftenest repeated. None where
    no way was travelled in both directions with a force that changes.
    """
    loops = [
        MajorLoop(up, down)
        for up in kinds
        if up.rising
        for down in kinds
        if not down.rising and abs(up.position - down.end) <= near and abs(up.end - down.position) <= near
    ]
    loops = [loop for loop in loops if loop.forces[1] > loop.forces[0]]
    if not loops:
        return None
    longest = max(loop.length for loop in loops)
    for often in (THRICE, 2, 1):
        some = [loop for loop in loops if loop.repeats >= often and loop.length >= HALF * longest]
        if some:
            break
    large = max(loop.length for loop in some)
    return max(
        (loop for loop in some if loop.length >= ALIKE * large), key=lambda loop: (loop.repeats, loop.length)
    )
