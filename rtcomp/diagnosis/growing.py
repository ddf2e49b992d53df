"""Growing: a model with each of its best candidates, fitted in full."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates import Candidate, started
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fit import Fitter
from rtcomp.diagnosis.fitted import Fitted
from rtcomp.diagnosis.free import Term
from rtcomp.diagnosis.screening import Screened
from rtcomp.diagnosis.settings import FULL_FITS
from rtcomp.errors import ConfigError

SCANNED, AWAY = 14, 10.0
"""Values of a number that are tried where first order is no guide; how many times its default they go to."""


def grow(
    fitter: Fitter, model: Fitted, made: Sequence[Candidate], screened: Sequence[Screened], ends: float
) -> list[Fitted]:
    """Return the model with each of the best candidates, fitted in full."""
    families: dict[str, list[Term]] = {}
    gains: dict[str, float] = {}
    for i in np.argsort([-s.gain for s in screened], kind="stable").tolist():
        families.setdefault(made[i].family, []).append(started(made[i], screened[i].sizes))
        gains.setdefault(made[i].family, screened[i].gain)
    least = min([*gains.values()][:FULL_FITS], default=0.0)
    terms = fitter.rough(model, list(families.values()), FULL_FITS, ends)
    # First order is no guide to what is behind a play: its own motion is followed from place to place.
    behind = {c.name: c.term for c in made if fitter.by_force and ent.kind_of(c.term.entry).behind}
    terms = [t for t in terms if t.entry["name"] not in behind]
    for term in behind.values():
        terms += _scanned(fitter, model, term, least, ends)
    found = fitted_in_time(fitter, model, terms, ends)
    return [*found, *fitted_in_time(fitter, model, _in_better_form(fitter, found, ends), ends)]


def _in_better_form(fitter: Fitter, found: Sequence[Fitted], ends: float) -> list[Term]:
    """Return the last terms in another form, where that leaves less at the same values."""

    def better_than(larger: Fitted, term: Term) -> bool:
        if time.monotonic() > ends:
            return False
        try:
            return fitter.quick([*larger.terms[:-1], term]) < larger.sse
        except (ConfigError, np.linalg.LinAlgError):
            return False

    better = []
    for larger in found:
        term = larger.terms[-1]
        kind = ent.kind_of(term.entry)
        for p in kind.parameters:
            if p.name not in term.entry or not ent.is_form(kind, p):
                continue
            others = [v for v in (kind.search_grid.get(p.name) or (p.low, p.high)) if v != term.entry[p.name]]
            made = [term.with_entry({**term.entry, p.name: value}) for value in others]
            better += [one for one in made if better_than(larger, one)]
    return better


def fitted_in_time(fitter: Fitter, model: Fitted, terms: Sequence[Term], ends: float) -> list[Fitted]:
    """Return the model with each term, fitted, where that is possible; none is begun after `ends` (s)."""

    def fit(term: Term) -> Fitted | None:
        if time.monotonic() > ends:
            return None
        try:
            return fitter.fit([*model.terms, term], model)
        except (ConfigError, np.linalg.LinAlgError):
            return None

    return [f for f in shared(fit, terms) if f is not None]


def _scanned(fitter: Fitter, model: Fitted, term: Term, least: float, ends: float) -> list[Term]:
    """Return the term at the length at which a model with it fits best; none where it fits best without.

    Where this gains as much as the `least` of what is fitted in full, also with those numbers free that else
    have their defaults: how a load meets the ends of its play decides which length fits. They are looked
    through one after the other, frequencies first, of which many fit almost, then the length again.
    """
    length = next(p.name for p in ent.free_parameters(term.entry, linear=False) if p.unit == "m")
    stated = [p for p in ent.kind_of(term.entry).parameters if p.default is not None]
    low, high = fitter.balance.data.stroke
    lengths = np.geomspace(2.0 * fitter.balance.grain, 0.25 * (high - low), SCANNED)

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
