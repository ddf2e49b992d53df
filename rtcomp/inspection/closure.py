"""Wiping-out: does a minor loop close where it began?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.inspection.branches import Branch
from rtcomp.inspection.chance import LEAST, SURE, Verdict
from rtcomp.kernels import Floats

INSIDE = 0.95
"""A minor loop's first branch is shorter than this part of those before and after it."""


@dataclass(frozen=True)
class Closure:
    """Gaps of minor loops: force on coming back to the turning point, less that on leaving it.

    gaps: (n,), N. upper: (n,), 1 where the loop hangs below its turning point (on a rising branch), else 0.
    """

    gaps: Floats
    upper: Floats
    force_range: float
    """N: what the figures are parts of."""

    @property
    def rms(self) -> float:
        """Rms gap, N; NaN without minor loops."""
        return float(np.sqrt(np.mean(self.gaps**2))) if self.gaps.size else math.nan

    @property
    def scatter(self) -> float:
        """Standard deviation of the gaps about their mean for each direction, N; NaN of too few."""
        parts = [self.gaps[self.upper == side] for side in (0.0, 1.0)]
        free = sum(max(part.size - 1, 0) for part in parts)
        if free == 0:
            return math.nan
        return math.sqrt(sum(float(np.sum((p - p.mean()) ** 2)) for p in parts if p.size) / free)

    @property
    def means(self) -> dict[str, float]:
        """Mean gap (N) of the loops on rising and on falling branches, where there are any."""
        sides = {"rising": 1.0, "falling": 0.0}
        return {
            name: float(self.gaps[self.upper == s].mean())
            for name, s in sides.items()
            if (self.upper == s).any()
        }

    @property
    def verdict(self) -> Verdict:
        """Say whether minor loops close: a t-test of the mean gap for each direction."""
        from scipy.special import stdtrit

        if self.gaps.size == 0:
            return "not-testable"
        if max(abs(mean) for mean in self.means.values()) < LEAST * self.force_range:
            return "holds"
        answers: list[Verdict] = []
        for side in (0.0, 1.0):
            part = self.gaps[self.upper == side]
            if part.size == 0 or abs(part.mean()) < LEAST * self.force_range:
                continue
            if part.size < 3:
                answers.append("undecided")
                continue
            off = float(part.std(ddof=1)) / math.sqrt(part.size)
            # Two directions are asked: each may err half as often.
            allowed = float(stdtrit(part.size - 1, 1.0 - SURE / 4.0)) * off
            answers.append("fails" if abs(part.mean()) > allowed else "holds")
        return "fails" if "fails" in answers else "undecided" if "undecided" in answers else "holds"


def closure(branches: Sequence[Branch], force_range: float) -> Closure:
    """Return the gaps of the minor loops among consecutive `branches` (all of a motion, in order).

    A branch that is shorter than the one before it is a minor loop where the next one comes back to its
    turning point.
    """
    gaps, upper = [], []
    for before, inside, after in zip(branches, branches[1:], branches[2:], strict=False):
        follows = before.rising != inside.rising != after.rising
        if not (follows and inside.length < INSIDE * before.length and inside.length < INSIDE * after.length):
            continue
        back = abs(inside.position - after.position)
        if back > after.length:
            continue
        come = after.force + after.sign * float(after.at(np.array([back]))[0])
        gaps.append(come - inside.force)
        upper.append(0.0 if inside.rising else 1.0)
    return Closure(np.array(gaps), np.array(upper), force_range)
