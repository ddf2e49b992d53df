"""Scans: what is behind a play, which has a motion of its own, is looked for from place to place."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.excerpt import excerpt, with_few_units
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.numerics.grids import chessboard
from rtcomp.diagnosis.settings import LEAST_GAIN
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Parameter

FASTER = 1.8
"""Ratio of frequencies, and of lengths, that are looked through."""
STIFFER = range(-1, 5)
"""Powers of it by which a load swings faster against the ends of its play than the axis on its friction."""
PARTS = 4
"""Values of what has no unit, as the share of the mass behind a play: one that is a tenth off fits worse than
no play at all."""
BEST, TRIES, FIRST = 2, 50, 0.3
"""Points from which the least is looked for, how often each, and its first steps (logarithm)."""
IMPOSSIBLE = 1e300
"""What is left where numbers are out of their bounds, or the time is up."""
NEAR = 5
"""Lengths around that at which the term as stated is looked at."""


def scanned(fitter: Fitter, model: Fitted, term: Term, ends: float) -> list[Term]:
    """Return the term with all its numbers where a model with it fits best, and with its length alone.

    How heavy a load is and how it meets the ends of its play decides which length fits: all are looked
    through together, every second point of a grid, on a part of the balance. From the best the least is
    looked for by simplex (Nelder and Mead 1965, Computer Journal 7(4)): what leaves when the load is met a
    little earlier has no useful slope. None where the model fits best without, or nothing moves.
    """
    some = excerpt(fitter, model)
    if some is None:
        return []
    length = next(p.name for p in ent.free_parameters(term.entry, linear=False) if p.unit == "m")
    stated = [p for p in ent.kind_of(term.entry).parameters if p.default is not None]
    names = [*(p.name for p in stated), length]
    defaults = {**{p.name: p.default for p in stated}, **term.entry}
    few = with_few_units(some, model)
    left, from_afar = (_left(one, model, term, ends) for one in (some, few))
    without = some.quick(model.terms)
    swings = math.sqrt(max(float(model.weights.sum()), 0.0) / fitter.balance.stage.mass) / (2.0 * math.pi)
    grids = [[swings * FASTER**k for k in STIFFER] if p.unit == "Hz" else _within(p) for p in stated]
    grids.append(_lengths(fitter))
    points = chessboard(grids, range(len(grids)))
    tried = shared(lambda point: from_afar({**defaults, **dict(zip(names, point, strict=True))}), points)
    if not min(tried) < (1.0 - LEAST_GAIN) ** 2 * few.quick(model.terms):
        return []  # nor near any of them, or too little to matter
    begun = [points[i] for i in np.argsort(tried, kind="stable")[:BEST]]

    def least(point: tuple[float, ...]) -> tuple[float, Entry]:
        return _least(lambda at: left({**defaults, **dict(zip(names, at, strict=True))}, 2), names, point)

    found, entry = min(shared(least, begun), key=lambda one: one[0])
    if not found < without:
        return []
    near = float(entry[length]) * np.geomspace(1.0 / FASTER, FASTER, NEAR)
    as_stated = [{**term.entry, length: float(each)} for each in near]
    alone = min(
        zip(shared(lambda e: left({**defaults, **e}), as_stated), as_stated, strict=True),
        key=lambda one: one[0],
    )
    return [Term.of({**defaults, **entry}), *([term.with_entry(alone[1])] if alone[0] < without else [])]


def _least(
    left: Callable[[Floats], float], names: list[str], point: tuple[float, ...]
) -> tuple[float, Entry]:
    """Return what is left at the point where that is least near a first one, and its numbers."""
    from scipy.optimize import minimize

    def left_at(logs: Floats) -> float:
        return min(left(np.exp(logs)), IMPOSSIBLE)  # of two infinities there is no difference

    at = np.log(np.array(point))
    simplex = np.vstack([at, at + FIRST * np.eye(at.size)])
    done = minimize(left_at, at, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": TRIES})
    return float(done.fun), dict(zip(names, np.exp(done.x).tolist(), strict=True))


def _within(p: Parameter) -> list[float]:
    """Return values within a parameter's range, evenly apart."""
    return [float(each) for each in np.linspace(p.low, p.high, PARTS + 2)[1:-1]]


def _lengths(fitter: Fitter) -> list[float]:
    """Return lengths (m) of a play, from two grains to a quarter of the stroke."""
    low, high = fitter.balance.data.stroke
    shortest, longest = 2.0 * fitter.balance.grain, 0.25 * (high - low)
    count = 2 + int(math.log(max(longest / shortest, 1.0)) / math.log(FASTER))
    return [float(each) for each in np.geomspace(shortest, longest, count)]


def _left(fitter: Fitter, model: Fitted, term: Term, ends: float) -> Callable[..., float]:
    """Return what tells what a model with an entry leaves, friction fitted so many times in turn."""
    weights = fitter.balance.weights  # believed: a fit without the play takes it for longer reaches
    if not weights.any():
        weights = fitter.fit(model.terms, steps=0).weights

    frequencies = [p for p in ent.kind_of(term.entry).parameters if p.unit == "Hz" and p.default is not None]

    def left(entry: Entry, turns: int = 1) -> float:
        if clock.now() > ends:
            return math.inf
        at_hand, sse = weights, math.inf
        if any(entry[p.name] > fitter.balance.data.rate for p in frequencies):
            return math.inf  # as good as rigid, and many steps
        try:
            for _ in range(turns):
                found = fitter.solve([*model.terms, term.with_entry(entry)], at_hand, 1.0)
                at_hand, sse = found.c[fitter.balance.friction], found.sse
        except (ConfigError, np.linalg.LinAlgError):
            return math.inf
        return sse

    return left
