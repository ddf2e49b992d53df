"""A force that is shown to go smoothly by the position, and no more: the plainest name for it.

A wave that was not seen to repeat and a stop in the middle of the stroke are smooth functions of the position
there. Where they leave more than noise, their form does not show them either. A spring by any law is every
such function: it claims nothing that was not seen.
"""

from __future__ import annotations

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.effects import searchable
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.other_forms import errors_beside, of_position
from rtcomp.diagnosis.numerics.significance import Null, log_gain
from rtcomp.diagnosis.search.acceptance import impossible
from rtcomp.diagnosis.settings import LEVEL


def by_plain_laws(fitter: Fitter, chosen: Fitted, null: Null | None) -> Fitted:
    """Return a model with a plain law of the position in the place of what may only be bent to it.

    Unless the model leaves no more than noise: then its forms are right.
    """
    if null is None or null.p_of_error(chosen.errors) >= LEVEL:
        return chosen
    for i in range(len(chosen.terms)):
        if bent(fitter, chosen.entries[i]):
            chosen = min(_plain(fitter, chosen, i), key=lambda m: m.sse, default=chosen)
    return chosen


def bent(fitter: Fitter, entry: Entry) -> bool:
    """Tell whether an entry is a smooth function of the position on this stroke, by numbers that bend it."""
    if not fitter.by_force or ent.kind_of(entry).known_law or not ent.shape_parameters(entry):
        return False
    return of_position(fitter.balance, entry).size > 0


def goes_plainly(fitter: Fitter, entry: Entry) -> bool:
    """Tell whether an entry is a smooth function of the position that no number bends."""
    return not ent.shape_parameters(entry) and of_position(fitter.balance, entry).size > 0


def _plain(fitter: Fitter, chosen: Fitted, at: int) -> list[Fitted]:
    """Return models with a law that no number bends in the place of effect number `at`.

    Those that in any form explain as much.
    """
    found = []
    others = [t for i, t in enumerate(chosen.terms) if i != at]
    rest = fitter.fit(others, chosen)
    for kind in searchable(fitter.balance):
        entry: Entry = {"name": kind.name, **dict.fromkeys(kind.linear, 1.0)}
        plain = fitter.linear(kind) and all(p.name in entry for p in kind.parameters)
        if not plain or kind.name in ent.names(rest.entries) or not goes_plainly(fitter, entry):
            continue
        model = fitter.fit([*others[:at], Term.of(entry), *others[at:]], chosen)
        errors = errors_beside(fitter, model, fitter.variants(model, at))
        if not impossible(fitter, model, rest) and log_gain(chosen.errors, errors) >= 0.0:
            found.append(model)
    return found
