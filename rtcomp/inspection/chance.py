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
_EXACT, _DRAWN, _BATCH = 2000, 1999, 250

Numbers = npt.NDArray[np.intp]


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


def distances(curves: Floats, until: Numbers) -> Floats:
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


def compare(square: Floats, kinds: Numbers, strata: Numbers, seed: int = 0) -> Compared:
    """Compare curves of different kinds by their mean square differences `square` (n, n).

    `kinds` (n,) numbers the kinds; only curves of one of the `strata` (n,) are compared (branches of one
    direction, say), and every two kinds of one count alike. The p-value is that of a permutation test of the
    kinds within the strata (Pesarin and Salmaso 2010, Permutation Tests for Complex Data): exact where there
    are few assignments, drawn otherwise.
    """
    kinds = np.unique(kinds, return_inverse=True)[1].reshape(-1).astype(np.intp)
    parts = [np.flatnonzero(strata == s) for s in np.unique(strata)]
    crossed, inside = _means(square, kinds[None, :], parts)
    between, within = float(crossed[0]), float(inside[0])
    if math.isnan(between) or math.isnan(within):
        return Compared(math.sqrt(between), math.sqrt(within), math.nan, 1.0)
    many = sum(_assignments(kinds[part]) for part in parts)
    exact = many <= math.log(_EXACT) and len(parts) == 1 and int(kinds.max()) == 1
    others = _splits(kinds) if exact else _shuffled(kinds, parts, np.random.default_rng(seed))
    told = []
    for first in range(0, len(others), _BATCH):
        crossed, inside = _means(square, others[first : first + _BATCH], parts)
        told.append(crossed - inside)
    as_much = np.count_nonzero(np.concatenate(told) >= between - within - 1e-9 * (between + within))
    p_value = as_much / len(others) if exact else (1 + as_much) / (1 + len(others))
    # Exchanging the names of two kinds of equal number is the same assignment.
    alike = sum(_exchanges(kinds[part]) for part in parts)
    smallest = max(math.exp(min(alike - many, 0.0)), 1.0 / (1 + _DRAWN))
    return Compared(math.sqrt(between), math.sqrt(within), float(p_value), smallest)


def _means(square: Floats, kinds: Numbers, parts: list[Numbers]) -> tuple[Floats, Floats]:
    """Return the mean squares between kinds (every two alike) and within kinds (every pair alike), (B,).

    kinds: (B, n), an assignment a row, each with as many curves of each kind in each of the `parts`.
    """
    between, within = np.zeros(len(kinds)), np.zeros(len(kinds))
    twos, pairs = 0, 0.0
    for part in parts:
        names = np.unique(kinds[0, part])
        member = (kinds[:, part, None] == names).astype(np.float64)
        sums = np.swapaxes(member, 1, 2) @ (square[np.ix_(part, part)] @ member)
        sizes = member[0].sum(axis=0)
        over = np.triu_indices(names.size, 1)
        between += (sums / np.outer(sizes, sizes))[:, over[0], over[1]].sum(axis=1)
        twos += over[0].size
        within += np.trace(sums, axis1=1, axis2=2)
        pairs += float(np.sum(sizes * (sizes - 1)))
    none = np.full(len(kinds), math.nan)
    return (between / twos if twos else none, within / pairs if pairs else none)


def _shuffled(kinds: Numbers, parts: list[Numbers], chance: np.random.Generator) -> Numbers:
    """Return _DRAWN random assignments, (_DRAWN, n), mixed within each part."""
    out = np.tile(kinds, (_DRAWN, 1))
    for part in parts:
        out[:, part] = chance.permuted(out[:, part], axis=1)
    return out


def _assignments(kinds: Numbers) -> float:
    """Return the logarithm of the number of different assignments of curves to kinds."""
    sizes = np.unique(kinds, return_counts=True)[1]
    return math.lgamma(kinds.size + 1) - sum(math.lgamma(n + 1) for n in sizes)


def _exchanges(kinds: Numbers) -> float:
    """Return the logarithm of the number of ways to exchange the names of kinds of equal number."""
    alike = np.unique(np.unique(kinds, return_counts=True)[1], return_counts=True)[1]
    return float(sum(math.lgamma(n + 1) for n in alike))


def _splits(kinds: Numbers) -> Numbers:
    """Return every assignment of two kinds, a row each."""
    chosen = np.array(list(combinations(range(kinds.size), int(np.count_nonzero(kinds == 0)))))
    out = np.ones((len(chosen), kinds.size), dtype=np.intp)
    np.put_along_axis(out, chosen, 0, axis=1)
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


def slope(x: Floats, y: Floats, blocks: Numbers) -> Slope | None:
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
