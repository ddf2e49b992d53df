"""Intervals that place themselves: the interval operator on a fine grid of cells, an interval a run of cells.

The paper asks for "an algorithmic solution to automatically optimise the interval setup during the training
process". To move a boundary while running one must know where inside an interval its activated parts lie.
Here each of many fine cells keeps its own amount, by the paper's own rule, so that the activations of any
intervals made of whole cells follow exactly, from bounded memory. `placing` says where the boundaries go.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import Basis, checked_keys, register_basis
from rtcomp.hysteresis.interval import IntervalBasis, way
from rtcomp.hysteresis.moving.places import (
    AMOUNTS,
    BEGUN,
    CELLS,
    COUNT,
    DIRECTION,
    EDGES,
    FIRST,
    FRONT,
    LAST,
    OWN,
    PATH,
)  # fmt: skip
from rtcomp.hysteresis.moving.placing import place, room
from rtcomp.kernels import Floats, basis_kernel

MOST_INTERVALS = 1000
"""Cells are 32 an interval and stand in the loop's memory three times over."""
CELLS_EACH, LEAST_CELLS = 32, 256
FINER = 1000.0
"""Width of the last cell over the first: virgin curves bend most where they begin."""


@basis_kernel
def self_placing_operator(p: Floats, s: Floats, x: Floats, u: float) -> None:
    """Equations (1) to (4) on the cells; the regressors are their sums over each interval.

    p, s: see `places`. x: x_i - a_i / 2 (m). What was passed since the last reversal is kept for `placing`.
    """
    distance = way(s, u)
    if distance == 0.0:
        return
    forward = distance > 0.0
    direction = 1.0 if forward else -1.0
    count, cells = int(p[COUNT]), int(p[CELLS])
    corner = EDGES + count + 1
    passed = AMOUNTS + cells
    if s[DIRECTION] != direction:
        s[DIRECTION] = direction
        s[FRONT] = s[OWN] = 0.0
        for c in range(int(s[FIRST]), int(s[LAST]) + 1):
            s[passed + c] = 0.0
        s[FIRST], s[LAST], s[PATH], s[BEGUN] = float(cells), -1.0, 0.0, 1.0
    distance = abs(distance)
    s[PATH] += distance
    c, j = int(s[FRONT]), int(s[OWN])
    while c < cells:
        width = p[corner + c + 1] - p[corner + c]
        amount = s[AMOUNTS + c]
        left = width - amount if forward else amount
        if left > 0.0:
            if c < s[FIRST]:
                s[FIRST] = float(c)
            s[LAST] = float(c)
        if distance < left:
            s[AMOUNTS + c] = amount + direction * distance
            s[passed + c] += distance
            x[j] += direction * distance
            break
        s[AMOUNTS + c] = width if forward else 0.0
        s[passed + c] += left
        x[j] += direction * left
        distance -= left
        c += 1
        if c == int(p[EDGES + j + 1]):  # saturated as a whole: said exactly, so that no rounding adds up
            x[j] = 0.5 * direction * (p[corner + c] - p[corner + int(p[EDGES + j])])
            j += 1
    s[FRONT], s[OWN] = float(c), float(j)


@register_basis
class SelfPlacingBasis(Basis):
    """Intervals that begin with the given widths (m) and move to where the virgin curve bends.

    Their number and their sum, the input range, stay. `widths` are those of the start; what a run made of
    them, `settled` says. Raises ConfigError for widths that the interval model does not take, or too many.
    """

    name = "self-placing"
    kernel = self_placing_operator
    placing = place
    source = "the paper's equations (1) to (6), on cells; places after the wish at the end of its section 4"

    def __init__(self, widths: Sequence[float] | Floats) -> None:
        self.widths = IntervalBasis(widths).widths
        if self.widths.size > MOST_INTERVALS:
            raise ConfigError(
                f"self-placing model: {self.widths.size} intervals; allowed are 1 to {MOST_INTERVALS} "
                "(model interval takes more)",
                key=("widths",),
            )
        self._edges, self._corners = cells_of(self.widths)

    @classmethod
    def over(cls, count: int, total: float, spacing: float = 1.0) -> SelfPlacingBasis:
        """Divide `total` (m) into `count` intervals, the last `spacing` times as wide as the first."""
        if count > MOST_INTERVALS:
            raise ConfigError(
                f"self-placing model: {count} intervals; allowed are 1 to {MOST_INTERVALS} "
                "(model interval takes more)",
                key=("intervals",),
            )
        return cls(IntervalBasis.over(count, total, spacing).widths)

    @property
    def size(self) -> int:
        """Number of intervals."""
        return int(self.widths.size)

    def vector(self) -> Floats:
        """Return N, the number of cells, the intervals' first cells, and the cells' corners (m)."""
        cells = self._corners.size - 1
        return np.concatenate([[float(self.size), float(cells)], self._edges.astype(float), self._corners])

    def initial_state(self) -> Floats:
        """Return the anhysteretic state (5): every cell half activated."""
        widths = np.diff(self._corners)
        head = np.zeros(AMOUNTS)
        head[FIRST], head[LAST] = widths.size, -1.0
        return np.concatenate([head, widths / 2, np.zeros(widths.size)])

    def scales(self) -> Floats:
        """Return half the widths of the start."""
        return self.widths / 2

    def memory(self, gate: float) -> Floats:
        """Return what `placing` remembers, before it has seen anything."""
        return room(self.size, self._corners.size - 1, gate)

    def settled(self, vector: Floats) -> IntervalBasis:
        """Return the intervals as they lie in the parameters `vector` of a run."""
        return IntervalBasis(widths_now(vector))

    def to_dict(self) -> dict[str, Any]:
        """Return name and widths of the start."""
        return {"model": self.name, "widths": [float(a) for a in self.widths]}

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> SelfPlacingBasis:
        """Build from ``{widths: [...]}``."""
        checked_keys(entry, cls.name, ["widths"])
        return cls(entry["widths"])


def cells_of(widths: Floats) -> tuple[Floats, Floats]:
    """Return the first cell of each interval and the end, (N + 1,), and the corners (m) of all cells.

    The boundaries that the intervals begin with are corners. Over the range the cells widen in geometric
    progression, but for what it takes to meet those.
    """
    ends = np.append(0.0, np.cumsum(widths))
    wanted = max(LEAST_CELLS, CELLS_EACH * widths.size)
    before = wanted * np.log1p((FINER - 1.0) * ends / ends[-1]) / math.log(FINER)
    each = np.maximum(1, np.round(np.diff(before))).astype(int)
    parts = [np.linspace(a, b, n + 1)[1:] for (a, b), n in zip(pairwise(before), each, strict=True)]
    places = np.concatenate(parts)
    corners = np.append(0.0, ends[-1] * np.expm1(places / wanted * math.log(FINER)) / (FINER - 1.0))
    edges = np.append(0, np.cumsum(each))
    corners[edges] = ends
    return edges, corners


def widths_now(vector: Floats) -> Floats:
    """Return the widths (m) of the intervals in the parameters `vector`, (N,)."""
    count = int(vector[COUNT])
    edges = vector[EDGES : EDGES + count + 1].astype(int)
    return np.diff(vector[EDGES + count + 1 :][edges])
