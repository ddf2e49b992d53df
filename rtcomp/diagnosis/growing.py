"""Growing: a model with each of its best candidates, fitted in full."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates import Candidate, started
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fit import STEPS, Fitter
from rtcomp.diagnosis.fitted import Fitted
from rtcomp.diagnosis.free import Term
from rtcomp.diagnosis.screening import Screened
from rtcomp.diagnosis.settings import FULL_FITS
from rtcomp.errors import ConfigError

SCANNED, BEGUN = 14, 4
"""Values of a length that are tried where first order is no guide; steps of a fit that is begun from them."""


def grow(
    fitter: Fitter, model: Fitted, made: Sequence[Candidate], screened: Sequence[Screened], ends: float
) -> list[Fitted]:
    """Return the model with each of the best candidates, fitted in full."""
    families: dict[str, list[Term]] = {}
    for i in np.argsort([-s.gain for s in screened], kind="stable").tolist():
        families.setdefault(made[i].family, []).append(started(made[i], screened[i].sizes))
    terms = fitter.rough(model, list(families.values()), FULL_FITS, ends)
    # First order is no guide to what is behind a play: its own motion is followed from place to place.
    behind = {c.name: c.term for c in made if fitter.gridded and ent.kind_of(c.term.entry).behind}
    terms = [t for t in terms if t.entry["name"] not in behind]
    for term in behind.values():
        terms += _scanned(fitter, model, term, ends)

    found = shared(lambda term: _fitted(fitter, model, term, ends), terms)
    return [f for f in found if f is not None]


def _fitted(fitter: Fitter, model: Fitted, term: Term, ends: float, steps: int = STEPS) -> Fitted | None:
    """Return the model with a term, fitted; None where that is impossible, or after the time `ends`."""
    if time.monotonic() > ends:
        return None
    try:
        return fitter.fit([*model.terms, term], model, steps)
    except (ConfigError, np.linalg.LinAlgError):
        return None


def _scanned(fitter: Fitter, model: Fitted, term: Term, ends: float) -> list[Term]:
    """Return the term at the length at which a model with it fits best; none where it fits best without.

    And with those numbers free too that else have their defaults: how a load meets the ends of its play
    decides which length fits, so this is begun from several around the best.
    """
    name = next(p.name for p in ent.free_parameters(term.entry, linear=False) if p.unit == "m")
    stated = {p.name: p.default for p in ent.kind_of(term.entry).parameters if p.default is not None}
    low, high = fitter.balance.data.stroke

    def at(value: float) -> Term:
        return term.with_entry({**term.entry, name: value})

    def error(value: float) -> float:
        if time.monotonic() > ends:
            return np.inf
        try:
            return fitter.quick([*model.terms, at(value)])
        except (ConfigError, np.linalg.LinAlgError):
            return np.inf

    def begun(value: float) -> Fitted | None:
        return _fitted(fitter, model, Term.of({**stated, **at(value).entry}), ends, BEGUN)

    grid = np.geomspace(2.0 * fitter.balance.grain, 0.25 * (high - low), SCANNED)
    errors = shared(error, grid.tolist())
    best = int(np.argmin(errors))
    if errors[best] >= model.sse:
        return []
    freed = [f for f in shared(begun, grid[max(best - 2, 0) : best + 2].tolist()) if f is not None]
    finer = np.geomspace(grid[max(best - 1, 0)], grid[min(best + 1, grid.size - 1)], SCANNED // 2)
    errors = shared(error, finer.tolist())
    found = [at(float(finer[int(np.argmin(errors))]))]
    return [*found, min(freed, key=lambda f: f.sse).terms[-1]] if freed else found
