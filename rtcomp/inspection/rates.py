"""Rate dependence: the same branch at another speed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.inspection.chance import LEAST, Slope, Verdict, slope
from rtcomp.inspection.kinds import Kind

APART = 2.0
"""Speeds of one kind must differ by this factor."""
MIDDLE = (0.25, 0.75)
"""Part of the travel over which a branch's level is taken: away from its reversals."""


@dataclass(frozen=True)
class Rates:
    """How the force of one branch goes with its speed; `change` is N for each doubling of the speed."""

    change: Slope | None
    speeds: tuple[float, float]
    """m/s, lowest and highest among the branches compared; NaN where there are none."""
    half_range: float
    """N: what the figures are parts of."""

    @property
    def verdict(self) -> Verdict:
        """Say whether it is the same at every speed."""
        if math.isnan(self.speeds[0]):
            return "not-testable"
        if self.change is None:
            return "undecided"
        doublings = math.log2(self.speeds[1] / self.speeds[0])
        large = abs(self.change.value) * doublings >= LEAST * self.half_range
        return "fails" if self.change.sure and large else "holds"


def rates(kinds: Sequence[Kind], half_range: float) -> Rates:
    """Compare repeats of each kind that were travelled at different speeds.

    The level of a branch is its mean force, in its direction, over the middle of its travel; its slope is
    taken over the logarithm of the speed, each kind having a level of its own.
    """
    speed, level, block = [], [], []
    for number, kind in enumerate(kinds):
        speeds = [b.speed for b in kind.repeats if b.speed > 0.0]
        if len(speeds) < 2 or max(speeds) < APART * min(speeds):
            continue
        middle = np.linspace(MIDDLE[0] * kind.length, MIDDLE[1] * kind.length, 50)
        for b in kind.repeats:
            if b.speed > 0.0:
                speed.append(b.speed)
                level.append(b.sign * b.force + float(b.at(middle).mean()))
                block.append(number)
    if not speed:
        return Rates(None, (math.nan, math.nan), half_range)
    change = slope(np.log2(np.array(speed)), np.array(level), np.array(block, dtype=np.intp))
    return Rates(change, (min(speed), max(speed)), half_range)
