"""How often what is named with a stated probability is right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtcomp.trial.figures import Figure
from rtcomp.trial.score import Scored

BINS = (
    ("above 0.99", 0.995),
    ("0.95 to 0.99", 0.95),
    ("0.9 to 0.95", 0.9),
    ("0.8 to 0.9", 0.8),
    ("0.5 to 0.8", 0.5),
    ("below 0.5", -np.inf),
)
"""As the report states probabilities, and from which probability on; the first one that fits holds."""


@dataclass(frozen=True)
class Stated:
    """Names given with probabilities of one bin: how many, their mean probability, how many were right."""

    says: str
    count: int
    mean: float | None
    right: int

    @property
    def figure(self) -> Figure:
        """The part that was right, with its interval."""
        return Figure(self.says, self.right / self.count if self.count else float("nan"), self.count)

    def to_json(self) -> dict[str, Any]:
        """Return it as ``trial.json`` holds it."""
        return {
            "stated": self.says, "count": self.count, "mean_stated": self.mean, "right": self.right,
            "interval": self.figure.interval,
        }  # fmt: skip


def calibration(rows: Sequence[Scored]) -> list[Stated]:
    """Return stated probability against frequency: a set of names is right if it holds what is hidden."""
    pairs = [
        (probability, names not in row.wrong)
        for row in rows
        if row.said is not None
        for names, probability in zip(row.said.named, row.said.probabilities, strict=False)
        if probability is not None
    ]
    result, above = [], np.inf
    for says, low in BINS:
        mine = [(p, right) for p, right in pairs if low < p <= above]
        mean = float(np.mean([p for p, _ in mine])) if mine else None
        result.append(Stated(says, len(mine), mean, sum(right for _, right in mine)))
        above = low
    return result
