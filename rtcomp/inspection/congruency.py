"""The congruency test: all branches from a common origin at their turning points (the paper's Fig. 11b)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rtcomp.inspection.branches import FREE, Branch, on_grid
from rtcomp.inspection.chance import Compared, Slope, Verdict, compare, distances, slope
from rtcomp.inspection.kinds import Kind
from rtcomp.kernels import Floats

POINTS = 160
MOST = 160
"""Branches that are compared at most."""
SHORTEST = 0.2
"""The travel over which stiffness is compared is one that four fifths of the kinds of branches have."""
_APART = 0.1
"""Turning points are at different places, or forces, where they differ by so much of the range."""


@dataclass(frozen=True)
class Congruency:
    """What branches from different turning points say, at equal travel.

    `branches` are those compared, `kind` (n,) the number of the kind of each. `rising`, `falling` and `both`
    are rms differences of two branches from different turning points beside those of two repeats.
    """

    branches: Sequence[Branch]
    kind: npt.NDArray[np.intp]
    force_range: float
    """N: what the figures are parts of."""
    rising: Compared
    falling: Compared
    both: Compared
    across: float
    """N, rms difference of a rising and a mirrored falling branch at equal travel."""
    over: float
    """m, travel over which stiffness is compared."""
    with_position: Slope | None
    """Relative change of stiffness as its place goes from the middle to the end of the stroke."""
    with_force: Slope | None
    """Relative change of stiffness as the size of the force there goes from 0 to half of the range."""

    @property
    def kinds(self) -> int:
        """Number of different turning points, and ways from there."""
        return int(np.unique(self.kind).size)

    @property
    def verdict(self) -> Verdict:
        """Say whether the branches are congruent."""
        return self.both.verdict(self.force_range)


def congruency(
    kinds: Sequence[Kind], force_range: float, centre: tuple[float, float], stroke: float, seed: int = 0
) -> Congruency:
    """Compare the branches of all `kinds`, each as far as it is free of the past.

    `force_range` (N) and `stroke` (m) are those of the motion, `centre` (m, N) their middles.
    """
    each = max(2, MOST // max(len(kinds), 1))
    chosen = [(number, one) for number, kind in enumerate(kinds) for one in kind.some(each)]
    if len(chosen) > MOST:
        chosen = [chosen[i] for i in np.linspace(0, len(chosen) - 1, MOST).round().astype(int)]
    some = [one for _, one in chosen]
    kind = np.array([number for number, _ in chosen], dtype=np.intp)
    rising = np.array([one.rising for one in some], dtype=np.intp)
    free = FREE * np.array([one.free for one in some])
    travel = np.linspace(0.0, float(free.max(initial=0.0)), POINTS)
    curves = on_grid(some, travel)
    until = np.searchsorted(travel, free * (1.0 + 1e-9), side="right").astype(np.intp)
    square = distances(curves, until)

    def among(rows: npt.NDArray[np.bool_]) -> Compared:
        return compare(square[np.ix_(rows, rows)], kind[rows], rising[rows], seed)

    crossed = square[np.ix_(rising == 1, rising == 0)]
    over, by_position, by_force = _stiffness(kinds, centre, stroke, force_range)
    return Congruency(
        some, kind, force_range, among(rising == 1), among(rising == 0), among(rising >= 0),
        math.sqrt(float(crossed.mean())) if crossed.size else math.nan, over, by_position, by_force,
    )  # fmt: skip


def _stiffness(
    kinds: Sequence[Kind], centre: tuple[float, float], stroke: float, force_range: float
) -> tuple[float, Slope | None, Slope | None]:
    """Return the travel over which stiffness is taken, and how it goes with position and force there.

    The stiffness of a kind is the force it gains over that travel. The place is the middle of that travel,
    the force the mean of its size along it, so that they mean the same in both directions; each direction has
    a level of its own.
    """
    free = np.array([FREE * min(b.free for b in kind.repeats) for kind in kinds])
    if free.size == 0:
        return 0.0, None, None
    over = float(np.quantile(free, SHORTEST))
    used = [kind for kind, far in zip(kinds, free, strict=True) if far >= over * (1.0 - 1e-9)]
    at = np.array([over])
    gained = np.array([np.mean([float(b.at(at)[0]) for b in kind.repeats]) for kind in used])
    sign = np.array([1.0 if kind.rising else -1.0 for kind in used])
    usual = float(np.mean(np.abs(gained)))
    if usual <= 0.0 or len(used) < 4:
        return over, None, None
    place = (np.array([kind.position for kind in used]) + 0.5 * sign * over - centre[0]) / (0.5 * stroke)
    first = np.array([kind.force for kind in used]) - centre[1]
    load = _size(first, first + sign * gained) / (0.5 * force_range)
    side = (sign > 0).astype(np.intp)
    by_position = slope(place, gained / usual, side) if np.ptp(place) > _APART else None
    by_force = slope(load, gained / usual, side) if np.ptp(load) > _APART else None
    return over, by_position, by_force


def _size(first: Floats, last: Floats) -> Floats:
    """Return the mean of |F| from F = `first` to F = `last` (N, (n,)): its integral over their difference."""
    both = np.abs(first) + np.abs(last)
    crossing = (first**2 + last**2) / np.where(both > 0.0, 2.0 * both, 1.0)
    return np.where(first * last < 0.0, crossing, 0.5 * both)
