"""Scans: what is behind a play, which has a motion of its own, is looked for from place to place."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fit import Fitter
from rtcomp.diagnosis.fitted import Fitted
from rtcomp.diagnosis.free import Term
from rtcomp.errors import ConfigError
from rtcomp.physics import Parameter

SCANNED, AWAY = 14, 10.0
"""Values of a number that are tried where first order is no guide; how many times its default they go to."""
CLOSE, SLOWER = 1.4, 1.8
"""Ratios of lengths and of frequencies in a wide scan: a play shows within a fifth of its gap, and where its
load meets the ends about as fast as it does."""
FREQUENCIES = 4
"""Frequencies of a wide scan, down from the default; of another number half as many."""
UNITS = 8
"""Friction units that do for it."""
NEAR, ROUNDS = 7, 2
"""Values around the best, of one number after the other, and how often that is done."""


def scanned(fitter: Fitter, model: Fitted, term: Term, least: float, ends: float) -> list[Term]:
    """Return the term at the length at which a model with it fits best; none where it fits best without.

    Where this gains as much as the `least` of what is fitted in full, also with those numbers free that else
    have their defaults: how a load meets the ends of its play decides which length fits. They are looked
    through one after the other, frequencies first, of which many fit almost, then the length again.
    """
    length, stated = _length(term), _stated(term)
    lengths = np.geomspace(*_lengths(fitter), SCANNED)
    best = _best_of(fitter, model, term, ends)
    left, alone = best(term.entry, length, lengths.tolist())
    if left >= model.sse:
        return []
    if math.log(model.sse / left) < least:
        return [term.with_entry(alone)]
    entry = {**{p.name: p.default for p in stated}, **alone}
    for p in sorted(stated, key=lambda p: p.unit != "Hz"):
        values = float(entry[p.name]) * np.geomspace(1.0 / AWAY, AWAY, SCANNED)
        values = values[(values > p.lowest) & (values < ent.highest(entry, p))]
        _, entry = best(entry, p.name, values.tolist())
    shorter = float(entry[length]) * np.geomspace(1.0 / AWAY, 1.0, SCANNED)
    _, entry = best(entry, length, shorter.tolist())
    return [term.with_entry(alone), Term.of(entry)]


def scanned_widely(fitter: Fitter, model: Fitted, term: Term, ends: float) -> list[Term]:
    """Return the term at the numbers with which a model with it fits best, all looked through together.

    With a few friction units, which do to see a play: far cheaper. None where it fits best without.
    """
    few = fitter.on(fitter.balance.data)
    coarse = few.balance.coarse
    step = float(np.log(coarse[-1] / coarse[0])) / (UNITS - 1)
    few.balance.put(np.geomspace(coarse[0], coarse[-1], UNITS), step)
    length, stated = _length(term), _stated(term)
    shortest, longest = _lengths(fitter)
    count = 2 + int(math.log(max(longest / shortest, 1.0)) / math.log(CLOSE))
    entry = {**{p.name: p.default for p in stated}, **term.entry}
    found = [(few.quick(model.terms), entry)]
    best = _best_of(few, model, term, ends)
    powers = [range(FREQUENCIES if p.unit == "Hz" else FREQUENCIES // 2) for p in stated]
    for power in itertools.product(*powers):
        less = {p.name: float(entry[p.name]) / SLOWER**k for p, k in zip(stated, power, strict=True)}
        found.append(best({**entry, **less}, length, np.geomspace(shortest, longest, count).tolist()))
    _, entry = min(found, key=lambda one: one[0])
    if entry is found[0][1]:
        return []
    for _ in range(ROUNDS):
        for name, most in [(p.name, ent.highest(entry, p)) for p in stated] + [(length, longest)]:
            values = float(entry[name]) * np.geomspace(1.0 / SLOWER, SLOWER, NEAR)
            _, entry = best(entry, name, values[values < most].tolist())
    return [Term.of(entry)]


def _lengths(fitter: Fitter) -> tuple[float, float]:
    """Return the shortest and the longest length (m) of a play: two grains, a quarter of the stroke."""
    low, high = fitter.balance.data.stroke
    return 2.0 * fitter.balance.grain, 0.25 * (high - low)


def _length(term: Term) -> str:
    return next(p.name for p in ent.free_parameters(term.entry, linear=False) if p.unit == "m")


def _stated(term: Term) -> list[Parameter]:
    return [p for p in ent.kind_of(term.entry).parameters if p.default is not None]


def _best_of(
    fitter: Fitter, model: Fitted, term: Term, ends: float
) -> Callable[[Entry, str, Sequence[float]], tuple[float, Entry]]:
    """Return what tells which of an entry and others with other values of a number leaves least."""

    def error(entry: Entry) -> float:
        if time.monotonic() > ends:
            return np.inf
        try:
            return fitter.quick([*model.terms, term.with_entry(entry)])
        except (ConfigError, np.linalg.LinAlgError):
            return np.inf

    def best(entry: Entry, name: str, values: Sequence[float]) -> tuple[float, Entry]:
        tried = [entry, *({**entry, name: value} for value in values)]
        return min(zip(shared(error, tried), tried, strict=True), key=lambda one: one[0])

    return best
