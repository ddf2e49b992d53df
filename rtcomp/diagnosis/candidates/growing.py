"""Growing: a model with each of its best candidates, fitted in full."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.effects import Candidate, started
from rtcomp.diagnosis.candidates.scanning import scanned
from rtcomp.diagnosis.candidates.screening import Look, Screened
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.settings import FULL_FITS
from rtcomp.errors import ConfigError

Start = tuple[Candidate, Screened]
Kind = TypeVar("Kind")


def grow(
    fitter: Fitter, model: Fitted, made: Sequence[Candidate], screened: Sequence[Screened], ends: float
) -> list[Fitted]:
    """Return the model with each of the best candidates, fitted in full: each effect once, then other forms.

    A fit that goes on in another form finds it (`in_better_form`), but not another effect.
    """
    families: dict[str, list[Start]] = {}
    for candidate, some in zip(made, screened, strict=True):
        families.setdefault(candidate.family, []).append((candidate, some))
    starts = [likeliest(each, lambda s: s[1].gain, lambda s: s[1].left) for each in families.values()]
    order = likeliest(starts, lambda each: each[0][1].gain, lambda each: min(s.left for _, s in each))
    first = {each[0][0].name: each[0][0].family for each in reversed(order)}
    order.sort(key=lambda each: first[each[0][0].name] != each[0][0].family)
    terms = fitter.rough(model, [[started(c, s.sizes) for c, s in each] for each in order], FULL_FITS, ends)
    # First order is no guide to what is behind a play: its own motion is followed from place to place.
    behind = {c.name: c.term for c in made if fitter.by_force and ent.kind_of(c.term.entry).behind}
    terms = [t for t in terms if t.entry["name"] not in behind]
    terms += [one for term in behind.values() for one in scanned(fitter, model, term, ends)]
    found = fitted_in_time(fitter, model, terms, ends)
    return [*found, *fitted_in_time(fitter, model, in_better_form(fitter, found, ends), ends)]


def likeliest(
    some: Sequence[Kind], gain: Callable[[Kind], float], left: Callable[[Kind], float]
) -> list[Kind]:
    """Sort by gain, largest first, and move the item with the smallest squared error to second place.

    The gain averages over blocks, relative to the error of each. While another effect is missing, a correct
    start may reduce the error in a few blocks only, and so have a negative gain.
    """
    order = sorted(some, key=gain, reverse=True)
    least = min(range(len(order)), key=lambda i: left(order[i]), default=0)
    if least > 1:
        order.insert(1, order.pop(least))
    return order


def events_of(fitter: Fitter, model: Fitted, seen: Look, ends: float) -> list[Fitted]:
    """Return the model with each single event, fitted; their gain, a mean over blocks, is small."""
    events = [c.term for c in seen.candidates if not c.looked and ent.happens_once(ent.kind_of(c.term.entry))]
    return fitted_in_time(fitter, model, events, ends)


def in_better_form(fitter: Fitter, found: Sequence[Fitted], ends: float) -> list[Term]:
    """Return the last terms in another form, where that leaves less at the same values."""

    def better_than(larger: Fitted, term: Term) -> bool:
        if clock.now() > ends:
            return False
        try:
            return fitter.quick([*larger.terms[:-1], term]) < larger.sse
        except (ConfigError, np.linalg.LinAlgError):
            return False

    better = []
    for larger in found:
        term = larger.terms[-1]
        made = [term.with_entry(entry) for entry in ent.in_other_forms(term.entry)]
        better += [one for one in made if better_than(larger, one)]
    return better


def fitted_in_time(fitter: Fitter, model: Fitted, terms: Sequence[Term], ends: float) -> list[Fitted]:
    """Return the model with each term, fitted, where that is possible; none is begun after `ends` (s)."""

    def fit(term: Term) -> Fitted | None:
        if clock.now() > ends:
            return None
        try:
            return fitter.fit([*model.terms, term], model)
        except (ConfigError, np.linalg.LinAlgError):
            return None

    return [f for f in shared(fit, terms) if f is not None]
