"""How times are spread: which were seen how often, their percentiles, and the slots that they cost."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]

SHARES = {"p50_us": 50.0, "p99_us": 99.0, "p999_us": 99.9}
"""The percentiles that are told, by name."""


@dataclass(frozen=True)
class Spread:
    """Times (us, ascending, each once) and how often each was seen."""

    values: Floats
    counts: Counts

    @classmethod
    def of(cls, times_us: npt.ArrayLike) -> Spread:
        """Return the spread of single times (us)."""
        values, counts = np.unique(np.asarray(times_us, dtype=np.float64), return_counts=True)
        return cls(values, counts.astype(np.int64))

    @classmethod
    def counted(cls, seen: Mapping[float, int]) -> Spread:
        """Return the spread of a histogram, times (us) to how often; those never seen are left out."""
        pairs = sorted((time, count) for time, count in seen.items() if count > 0)
        return cls(
            np.array([time for time, _ in pairs], dtype=np.float64),
            np.array([count for _, count in pairs], dtype=np.int64),
        )

    @classmethod
    def joined(cls, parts: Iterable[Spread]) -> Spread:
        """Return the spread of all times of several."""
        listed = list(parts)
        times = np.concatenate([np.empty(0), *(p.values for p in listed)])
        counts = np.concatenate([np.empty(0, np.int64), *(p.counts for p in listed)])
        values, place = np.unique(times, return_inverse=True)
        sums = np.zeros(values.size, np.int64)
        np.add.at(sums, place, counts)
        return cls(values, sums)

    @property
    def total(self) -> int:
        """Times seen."""
        return int(self.counts.sum())

    def percentile(self, percent: float) -> float:
        """Return the least time (us) that at least `percent` of all are not longer than; NaN of none."""
        if not self.total:
            return math.nan
        rank = max(1, math.ceil(self.total * percent / 100.0 - 1e-9))
        return float(self.values[np.searchsorted(np.cumsum(self.counts), rank)])

    @property
    def longest(self) -> float:
        """us; NaN of none."""
        return float(self.values[-1]) if self.values.size else math.nan

    def missed(self, period_us: float) -> int:
        """Return how many slots passed altogether where these are latenesses of wake-ups of that period."""
        return int(np.sum(self.counts * np.floor(self.values / period_us + 1e-9).astype(np.int64)))

    def figures(self) -> dict[str, float]:
        """Return the percentiles and the longest, us, by name."""
        told = {name: self.percentile(percent) for name, percent in SHARES.items()}
        return {**told, "max_us": self.longest}


def ratio(ours: float, theirs: float) -> float | None:
    """Return ours over theirs; None where theirs is nothing (a clock that counts whole microseconds)."""
    return ours / theirs if theirs > 0.0 else None
