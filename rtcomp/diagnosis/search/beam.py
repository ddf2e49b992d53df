"""The beam: models kept at each step of the search, grown by one effect or two, and which of them go on."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.growing import events_of, fitted_in_time, grow
from rtcomp.diagnosis.candidates.screening import Look
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.numerics.significance import Null, log_gain
from rtcomp.diagnosis.search.acceptance import accepted, score
from rtcomp.diagnosis.settings import LEAST_GAIN, LEVEL

NEAR = 1.0
"""Logarithm of the error over the best one's, up to which a model is an alternative, and grown beside it."""


def grown_further(
    fitter: Fitter, beam: Sequence[Fitted], seen: Look, alone: Look, ends: float
) -> tuple[list[Fitted], bool]:
    """Return the best of the beam, beside which was `seen`, with one effect more, and so the others.

    And whether time cut it short: another is begun only where one that takes as long would end in time.
    Each other model is also fitted with the last effect of the best. If that model has a much larger error,
    or no candidate passes the test, only this effect is added. Its fit then starts from the values that the
    look beside the belief `alone` gives, because the fitted values may compensate for what is missing.
    """
    began, more = clock.now(), seen.null is not None and seen.null.p_value(seen.gain) < LEVEL
    found = grow(fitter, beam[0], seen.candidates, seen.screened, ends)
    for other in beam[1:]:
        moment = clock.now()
        if 2.0 * moment - began > ends:
            return found, True
        began = moment
        last = [t for t in beam[0].terms[-1:] if t.entry["name"] not in ent.names(other.entries)]
        if more and score(other) < score(beam[0]) + NEAR:
            found += grow(fitter, other, *seen.beside(other), ends)
        elif last:
            found += grow(fitter, other, *alone.beside(other, only=last[0].entry["name"]), ends)
        found += fitted_in_time(fitter, other, last, ends)
    return found, clock.now() > ends


def with_two(
    fitter: Fitter, model: Fitted, seen: Look, one_more: Sequence[Fitted], ends: float
) -> list[Fitted]:
    """Return a model with two more effects: the one with the smallest squared error, and each candidate.

    Used where no effect passes the test alone. The test averages over blocks. A correct effect may reduce the
    error in a few blocks only, while a second missing effect dominates the others.
    """
    best = min([*one_more, *events_of(fitter, model, seen, ends)], key=lambda m: m.sse, default=model)
    if best.sse >= (1.0 - LEAST_GAIN) ** 2 * model.sse or best.at_bound:
        return []
    return grow(fitter, best, *seen.beside(best), ends)


def in_other_forms(
    fitter: Fitter, chosen: Fitted, alternatives: Sequence[Fitted], grown: Sequence[Fitted], ends: float
) -> list[Fitted]:
    """Return the best model with its last effect beside other forms of those before it.

    The form that suits them alone may be bent to do without the last.
    """
    names = ent.names(chosen.entries)
    larger = [g for g in grown if ent.names(g.entries)[:-1] == names]
    if not larger:
        return []
    alike = [m for m in alternatives if ent.names(m.entries) == names and not m.at_bound]
    near = [m for m in alike if score(m) < score(chosen) + NEAR]
    last = min(larger, key=score).terms[-1:]
    return [model for other in near for model in fitted_in_time(fitter, other, last, ends)]


def beats(fitter: Fitter, model: Fitted, chosen: Fitted, null: Null, everything: float) -> bool:
    """Tell whether a model beats that of the step before: a larger one by the one test."""
    if len(model.terms) > len(chosen.terms):
        return accepted(fitter, model, chosen, null, everything)
    return score(model) < score(chosen)


def shown_by_more_than_fitting(
    beam: Sequence[Fitted], chosen: Fitted, null: Null, ends: float = math.inf
) -> list[Fitted]:
    """Return the beam without the models at its head whose new effects gain as much on replicates.

    They are fitted there too: what grows far from its start gains little to first order, and two together
    more than one. Not asked after the time `ends` (clock.now).
    """
    for i, model in enumerate(beam):
        gain = log_gain(chosen.errors, model.errors)
        larger = len(model.terms) > len(chosen.terms)
        if null.in_full is None or not larger or clock.now() > ends:
            return list(beam[i:])
        more = null.in_full(model.terms[len(chosen.terms) :]).mean() - null.gains.mean()
        if null.p_value(gain - max(float(more), 0.0)) < LEVEL:
            return list(beam[i:])
    return []


def refitted(fitter: Fitter, models: Sequence[Fitted]) -> list[Fitted]:
    """Return models fitted again, each from where it was."""
    return shared(lambda m: fitter.fit(m.terms, m), models)


def grown_from(model: Fitted, beam: Sequence[Fitted]) -> Fitted:
    """Return the largest model that a model was grown from."""
    names = ent.names(model.entries)
    own = [b for b in beam if len(b.terms) < len(names) and ent.names(b.entries) == names[: len(b.terms)]]
    return max(own, key=lambda b: len(b.terms))


def distinct(models: Sequence[Fitted]) -> list[Fitted]:
    """Return the first of models with the same effects, in their order."""
    found: list[Fitted] = []
    for m in models:
        if all(sorted(ent.names(m.entries)) != sorted(ent.names(f.entries)) for f in found):
            found.append(m)
    return found
