"""What a claim of the paper is once it has been tested: a sentence, a criterion, a number, true or false."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt


class Spread(NamedTuple):
    """Median, smallest and largest of what several seeds gave; infinite where it never happened."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Return the spread of `values` (at least one, no NaN; infinities are the largest)."""
        ordered = sorted(float(v) for v in values)
        low, high = ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2]
        middle = low if low == high else 0.5 * (low + high)
        return cls(middle, ordered[0], ordered[-1])


def ratio(after: float, before: float) -> float:
    """Return `after` over `before`, both at least 0; 1 where both never happened, infinite for `after` alone.

    Of two cycle counts: above 1 where it took longer. 0 where only `before` never happened.
    """
    if math.isinf(after) and math.isinf(before):
        return 1.0
    if math.isinf(before):
        return 0.0
    return math.inf if before == 0.0 or math.isinf(after) else after / before


def cycles_until(errors: Sequence[float], level: float, stay: int) -> float:
    """Return the first cycle (from 1) of `stay` in a row with errors at most `level`; else infinity."""
    run = 0
    for number, error in enumerate(errors, 1):
        run = run + 1 if error <= level else 0
        if run == stay:
            return float(number - stay + 1)
    return math.inf


def participation(changes: npt.ArrayLike) -> float:
    """Return the share of elements that a change is spread over, (sum |c|)^2 / (N sum c^2), 0 where none.

    1 where all change alike, 1/N where a single one does.
    """
    c = np.abs(np.asarray(changes, dtype=np.float64))
    power = float(np.sum(c**2))
    return float(np.sum(c)) ** 2 / (c.size * power) if power > 0.0 else 0.0


@dataclass(frozen=True)
class Claim:
    """One claim of the paper's text and what came out here."""

    name: str
    paper: str
    """What the paper says."""
    holds: bool
    value: Spread
    """Of what `quantity` names, over the seeds, in `unit`."""
    quantity: str
    unit: str
    criterion: str
    """When it is called true."""
    measured: str
    """How: stage, learner, step, motion, seeds."""
    remark: str = ""
    """Why it may differ, or what else was seen."""
    beside: dict[str, Any] = field(default_factory=dict)
    """Further numbers, by name with the unit in it."""

    def to_json(self) -> dict[str, Any]:
        """Return the claim as paper.json lists it; what never happened is null there."""
        return {
            "name": self.name,
            "paper": self.paper,
            "holds": self.holds,
            "value": self.value.median,
            "low": self.value.low,
            "high": self.value.high,
            "unit": self.unit,
            "quantity": self.quantity,
            "criterion": self.criterion,
            "measured": self.measured,
            "remark": self.remark,
            "beside": self.beside,
        }
