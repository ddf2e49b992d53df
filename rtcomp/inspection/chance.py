"""What chance alone would do: curves that differ by more than their own repeats, slopes with confidence."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
import numpy.typing as npt

from rtcomp.kernels import Floats

Verdict = Literal["holds", "fails", "undecided", "not-testable"]

LEAST = 0.005
"""Part of the force range below which a difference breaks no property: nobody's model is that good."""
SURE = 0.01
"""p-value from which on a difference is not chance."""
CLEAR = 4.0
"""Where too few repeats are there for a p-value: a difference this many times their scatter is not chance."""
_EXACT, _DRAWN = 2000, 1999


@dataclass(frozen=True)
class Compared:
    """Curves of different kinds against repeats of one kind: rms differences of two single curves.

    `p_value` is the share of random assignments of the curves to kinds that differ as much; NaN where no
    two repeats are there. `smallest_p` is what so few curves can reach at all.
    """

    between: float
    within: float
    p_value: float
    smallest_p: float

    @property
    def systematic(self) -> float:
        """What of the difference is not scatter: sqrt(between^2 - within^2)."""
        if math.isnan(self.within):
            return self.between
        return math.sqrt(max(self.between**2 - self.within**2, 0.0))

    def verdict(self, unit: float) -> Verdict:
        """Say whether the kinds are alike; differences below LEAST of `unit` are none."""
        if math.isnan(self.between):
            return "not-testable"
        if self.systematic < LEAST * unit:
            return "holds"
        if math.isnan(self.within):
            return "undecided"
        if self.smallest_p > SURE:
            return "fails" if self.between > CLEAR * self.within else "undecided"
        return "fails" if self.p_value <= SURE else "holds"


def distances(curves: Floats, until: npt.NDArray[np.intp]) -> Floats:
    """Return the mean square difference of every two `curves` (n, G), over the points both have: (n, n).

    Curve i counts up to its `until[i]`-th point.
    """
    count = curves.shape[0]
    out = np.zeros((count, count))
    for i in range(count):
        square = np.cumsum((curves[i] - curves) ** 2, axis=1)
        common = np.maximum(np.minimum(until[i], until), 1)
        out[i] = square[np.arange(count), common - 1] / common
    return out


def compare(
    square: Floats, kinds: npt.NDArray[np.intp], strata: npt.NDArray[np.intp], seed: int = 0
) -> Compared:
    """Compare curves of different kinds by their mean square differences `square` (n, n).

    `kinds` (n,) numbers the kinds; only curves of one of the `strata` (n,) are compared (branches of one
    direction, say), and every two kinds of one count alike. The p-value is that of a permutation test of the
    kinds within the strata (Pesarin and Salmaso 2010, Permutation Tests for Complex Data): exact where there
    are few assignments, drawn otherwise.
    """
    kinds = np.unique(kinds, return_inverse=True)[1].reshape(-1).astype(np.intp)
    between, within = _means(square, kinds, strata)
    if math.isnan(between) or math.isnan(within):
        return Compared(math.sqrt(between), math.sqrt(within), math.nan, 1.0)
    chance = np.random.default_rng(seed)
    many = sum(_assignments(kinds[strata == s]) for s in np.unique(strata))
    told = between - within
    slack = 1e-9 * (between + within)
    if many <= math.log(_EXACT) and np.unique(strata).size == 1 and np.unique(kinds).size == 2:
        every = [_told(square, k, strata) for k in _splits(kinds)]
        p_value = float(np.mean(np.array(every) >= told - slack))
    else:
        drawn = np.empty(_DRAWN)
        for number in range(_DRAWN):
            mixed = kinds.copy()
            for s in np.unique(strata):
                mixed[strata == s] = chance.permutation(kinds[strata == s])
            drawn[number] = _told(square, mixed, strata)
        p_value = float((1 + np.count_nonzero(drawn >= told - slack)) / (1 + _DRAWN))
    # Exchanging the names of two kinds of equal number is the same assignment.
    alike = sum(_exchanges(kinds[strata == s]) for s in np.unique(strata))
    smallest = max(math.exp(min(alike - many, 0.0)), 1.0 / (1 + _DRAWN))
    return Compared(math.sqrt(between), math.sqrt(within), p_value, smallest)


def _told(square: Floats, kinds: npt.NDArray[np.intp], strata: npt.NDArray[np.intp]) -> float:
    between, within = _means(square, kinds, strata)
    return between - within


def _means(square: Floats, kinds: npt.NDArray[np.intp], strata: npt.NDArray[np.intp]) -> tuple[float, float]:
    """Return the mean squares between kinds (every two alike) and within kinds (every pair alike)."""
    crossed = []
    inside, pairs = 0.0, 0
    for s in np.unique(strata):
        here = strata == s
        names, index = np.unique(kinds[here], return_inverse=True)
        member = np.zeros((index.size, names.size))
        member[np.arange(index.size), index.reshape(-1)] = 1.0
        sums = member.T @ square[np.ix_(here, here)] @ member
        sizes = member.sum(axis=0)
        over = np.triu_indices(names.size, 1)
        crossed.append((sums / np.outer(sizes, sizes))[over])
        inside += float(np.trace(sums))
        pairs += int(np.sum(sizes * (sizes - 1)))
    every = np.concatenate(crossed) if crossed else np.empty(0)
    return (float(every.mean()) if every.size else math.nan, inside / pairs if pairs else math.nan)


def _assignments(kinds: npt.NDArray[np.intp]) -> float:
    """Return the logarithm of the number of different assignments of curves to kinds."""
    sizes = np.unique(kinds, return_counts=True)[1]
    return math.lgamma(kinds.size + 1) - sum(math.lgamma(n + 1) for n in sizes)


def _exchanges(kinds: npt.NDArray[np.intp]) -> float:
    """Return the logarithm of the number of ways to exchange the names of kinds of equal number."""
    alike = np.unique(np.unique(kinds, return_counts=True)[1], return_counts=True)[1]
    return float(sum(math.lgamma(n + 1) for n in alike))


def _splits(kinds: npt.NDArray[np.intp]) -> list[npt.NDArray[np.intp]]:
    out = []
    for chosen in combinations(range(kinds.size), int(np.count_nonzero(kinds == kinds[0]))):
        mixed = np.ones(kinds.size, dtype=np.intp)
        mixed[list(chosen)] = 0
        out.append(mixed)
    return out


@dataclass(frozen=True)
class Slope:
    """A straight line through points: its slope with the 95 % interval, and the correlation."""

    value: float
    low: float
    high: float
    correlation: float
    points: int

    @property
    def sure(self) -> bool:
        """Whether its interval leaves zero out."""
        return self.low > 0.0 or self.high < 0.0

    def to_json(self) -> dict[str, float | int]:
        """Return it as inspect.json has it, value and interval in per cent."""
        return {
            "percent": 100 * self.value,
            "low_percent": 100 * self.low,
            "high_percent": 100 * self.high,
            "correlation": self.correlation,
            "points": self.points,
        }


def slope(x: Floats, y: Floats, blocks: npt.NDArray[np.intp]) -> Slope | None:
    """Return the slope of y over x, both (n,), with a level of its own for each of the `blocks` (n,).

    Ordinary least squares; None where points or the range of x do not suffice for a confidence.
    """
    from scipy.special import stdtrit

    names, index, sizes = np.unique(blocks, return_inverse=True, return_counts=True)
    index = index.reshape(-1)
    x = x - (np.bincount(index, x) / sizes)[index]
    y = y - (np.bincount(index, y) / sizes)[index]
    free = x.size - names.size - 1
    power = float(x @ x)
    if free < 2 or power <= 1e-12 * x.size:
        return None
    value = float(x @ y) / power
    rest = y - value * x
    off = float(stdtrit(free, 0.975)) * math.sqrt(float(rest @ rest) / free / power)
    spread = float(y @ y)
    return Slope(
        value,
        value - off,
        value + off,
        float(x @ y) / math.sqrt(power * spread) if spread > 0.0 else 0.0,
        x.size,
    )
