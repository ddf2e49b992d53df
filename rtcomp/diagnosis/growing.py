"""Growing: a model with each of its best candidates, fitted in full."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates import Candidate, started
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fit import Fitter
from rtcomp.diagnosis.fitted import Fitted
from rtcomp.diagnosis.free import Term
from rtcomp.diagnosis.screening import Screened
from rtcomp.diagnosis.settings import FULL_FITS
from rtcomp.errors import ConfigError

SCANNED = 14
"""Values of a length that are tried where first order is no guide."""


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
    terms += [t for t in (_scanned(fitter, model, term, ends) for term in behind.values()) if t is not None]

    def fit(term: Term) -> Fitted | None:
        if time.monotonic() > ends:
            return None
        try:
            return fitter.fit([*model.terms, term], model)
        except (ConfigError, np.linalg.LinAlgError):
            return None

    return [f for f in shared(fit, terms) if f is not None]


def _scanned(fitter: Fitter, model: Fitted, term: Term, ends: float) -> Term | None:
    """Return the term at the length at which a model with it fits best; None where none fits better."""
    name = next(p.name for p in ent.free_parameters(term.entry, linear=False) if p.unit == "m")
    low, high = fitter.balance.data.stroke
    grid = np.geomspace(2.0 * fitter.balance.grain, 0.25 * (high - low), SCANNED)

    def error(value: float) -> float:
        if time.monotonic() > ends:
            return np.inf
        entry = {**term.entry, name: value}
        try:
            return fitter.quick([*model.terms, term.with_entry(entry)])
        except (ConfigError, np.linalg.LinAlgError):
            return np.inf

    for _ in range(2):
        errors = shared(error, grid.tolist())
        at = int(np.argmin(errors))
        if errors[at] >= model.sse:
            return None
        value = float(grid[at])
        grid = np.geomspace(grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)], SCANNED // 2)
    return term.with_entry({**term.entry, name: value})
