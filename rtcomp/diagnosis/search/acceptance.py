"""Acceptance: whether an effect passes the one test, matters, and is a finding; what is left out again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.fitting.believed import beyond_belief, displaces_belief, within_belief
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.intervals import told
from rtcomp.diagnosis.fitting.other_forms import errors_beside, force_of, in_any_form, of_position
from rtcomp.diagnosis.numerics.significance import Null, log_gain
from rtcomp.diagnosis.search.confirmed import denied
from rtcomp.diagnosis.search.free_function import rival
from rtcomp.diagnosis.settings import LEAST_GAIN, LEFT, LEVEL, NEGLIGIBLE
from rtcomp.kernels import Floats

PLAINER = 1e-3
"""Logarithm of the error that one parameter more must gain to count at all."""
TOO_MUCH = "{:.0f} % of what there is without it is left, more than noise"
NOT_SHOWN = "it does not show in {}"
WEIGHTLESS = "beside it nothing of the mass is left"
STANDS_IN = "a force that goes by {} explains more{}, and more than noise is left"


def accepted(fitter: Fitter, model: Fitted, parent: Fitted, null: Null | None, everything: float) -> bool:
    """Tell whether the effect of a model that its parent has not passes the one test and matters.

    What other forms of the effects before it would explain as well is no further effect. What takes the place
    of believed mass or friction is none.
    """
    if null is None or impossible(fitter, model, parent):
        return False
    before_it = ent.names(parent.entries)
    forms = fitter.other_forms(parent, next((n for n in ent.names(model.entries) if n not in before_it), ""))
    before, after = errors_beside(fitter, parent, forms), errors_beside(fitter, model, forms)
    if null.p_value(log_gain(before, after)) >= LEVEL:
        return False
    believable = _as_believable(fitter, parent, model)
    if believable is not parent:
        parent, before = believable, believable.errors
    gained = math.sqrt(before.sum()) - math.sqrt(after.sum())
    if gained <= LEAST_GAIN * math.sqrt(everything):
        return False
    without = fitter.force(parent)
    there, left = (fitter.relative(each, seen=True, first=without) for each in (parent, model))
    return there**2 - left**2 > NEGLIGIBLE**2


def impossible(fitter: Fitter, model: Fitted, parent: Fitted) -> bool:
    """Tell whether a model is none: a number of it is at its bound, or an effect is not what it says.

    An effect that takes the place of believed mass or friction is none. An effect with memory, such as a
    hysteresis, is none where its fit is a smooth function of the position: the recording shows no memory.
    """
    if model.at_bound or not fitter.by_force:
        return model.at_bound
    remembers = [e for e in model.entries if ent.kind_of(e).states > 0]
    forgets = any(of_position(fitter.balance, e).size for e in remembers)
    return forgets or displaces_belief(fitter.balance, model, parent)


def _as_believable(fitter: Fitter, model: Fitted, larger: Fitted | None = None) -> Fitted:
    """Return a model with numbers within belief, unless those of a `larger` one are beyond it as well."""
    beyond = larger is not None and beyond_belief(fitter.balance, larger) if fitter.by_force else True
    return model if beyond else within_belief(fitter.balance, model)


def exhausted(fitter: Fitter, model: Fitted, everything: float) -> bool:
    """Tell whether a model leaves too little for any further effect to matter, its numbers believable."""
    model = _as_believable(fitter, model)
    little = math.sqrt(model.errors.sum()) <= LEAST_GAIN * math.sqrt(everything)
    return little or fitter.relative(model, seen=True) <= NEGLIGIBLE


def pruned(
    fitter: Fitter,
    model: Fitted,
    passed: Sequence[Fitted],
    null: Null | None,
    everything: float,
    ends: float,
) -> Fitted:
    """Return the model without effects that no longer pass the test beside the others.

    Beside the best of the models of these others: of the fit that is left, and of those that `passed` before.
    """
    while len(model.terms) > 1 and clock.now() < ends:
        rest = []
        for i in range(len(model.terms)):
            others = [*model.terms[:i], *model.terms[i + 1 :]]
            alike = [p for p in passed if _same(p.terms, others)]
            fits = [fitter.fit(others, model), *(fitter.fit(p.terms, p) for p in alike)]
            smaller = min(fits, key=score)
            if not accepted(fitter, model, smaller, null, everything):
                rest.append(smaller)
        if not rest:
            return model
        model = min(rest, key=score)
    return model


def _same(one: Sequence[Term], other: Sequence[Term]) -> bool:
    """Tell whether terms are of the same effects."""
    return sorted(str(t.entry["name"]) for t in one) == sorted(str(t.entry["name"]) for t in other)


def score(model: Fitted) -> float:
    """Return the logarithm of the error left out; of models that are alike, the plainer comes first."""
    return float(np.mean(np.log(model.errors))) + PLAINER * model.size


@dataclass(frozen=True)
class Doubt:
    """Why an effect of a model is no finding."""

    why: str
    """Empty where it is one."""
    left: float
    """Part that is left of what there is without it, squared and above the noise."""
    denied: bool = False
    """Whether it is the other objective that does not show it."""
    together: tuple[int, ...] = ()
    """Numbers of the effects that are no finding together, this one among them."""


def doubts(fitter: Fitter, chosen: Fitted, null: Null | None) -> list[Doubt]:
    """Return why each effect of a model is no finding.

    Its size may be nothing, a number of it is at a physical bound, or the mass at its own; or more is left
    beside it than noise and a part of what there is without it: what else makes the rest may make that part
    as well. The part is the geometric mean of that of the force and of that as the objective weighs it. What
    replicates of the model leave too is not counted as left. Or, where more than noise is left, a force that
    is any function of one thing explains more than it, or than several of them. Or it does not show in the
    other objective.
    """
    said = []
    more = null is not None and null.p_of_error(chosen.errors) < LEVEL
    for i, span in enumerate(told(fitter, chosen)):
        why = "its size may be nothing" if span.nothing else ""
        why = WEIGHTLESS if chosen.weightless else why
        why = f"{', '.join(span.bound)} at its bound" if span.bound else why
        left, elsewhere = 1.0, False
        if not why:
            others = fitter.fit([*chosen.terms[:i], *chosen.terms[i + 1 :]], chosen)
            without = _as_believable(fitter, others, chosen)
            rest = in_any_form(fitter, chosen, _only_forms(fitter, chosen, (i,)))
            there = in_any_form(fitter, without, _forms_beside(fitter, chosen, (i,)))
            left = math.sqrt(
                _of_the_force(fitter, rest, there, null) * _as_weighed(fitter, rest, there, null)
            )
            why = TOO_MUCH.format(100.0 * min(left, 1.0)) if more and left > LEFT else ""
            if not why and more:
                other = _outdone(fitter, chosen, without, (i,))
                why = STANDS_IN.format(other, "") if other else ""
            elsewhere = not why and denied(fitter, chosen, without)
            if elsewhere:
                why = NOT_SHOWN.format("simulated positions" if fitter.by_force else "forces")
        said.append(Doubt(why, left, elsewhere))
    return said if any(one.why for one in said) or not more else _together(fitter, chosen, said)


def _together(fitter: Fitter, chosen: Fitted, said: Sequence[Doubt]) -> list[Doubt]:
    """Return what was said of each effect, with the most of them that a force by one thing outdoes."""
    count = len(chosen.terms)
    for some in (s for size in range(count, 1, -1) for s in combinations(range(count), size)):
        without = fitter.fit([t for i, t in enumerate(chosen.terms) if i not in some], chosen)
        other = _outdone(fitter, chosen, without, some)
        if other:
            why = STANDS_IN.format(other, " than they do together")
            return [replace(one, why=why, together=some) if i in some else one for i, one in enumerate(said)]
    return list(said)


def _outdone(fitter: Fitter, chosen: Fitted, without: Fitted, some: Sequence[int]) -> str:
    """Return what a force goes by that explains more than `some` effects of a model, "" for none."""
    if not fitter.by_force:
        return ""
    errors = errors_beside(fitter, chosen, _only_forms(fitter, chosen, some))
    replaced = [(chosen.entries[i], force_of(fitter, chosen, i)) for i in some]
    return rival(fitter, without, errors, replaced)


def _only_forms(fitter: Fitter, chosen: Fitted, some: Sequence[int]) -> Floats:
    """Return the columns (q, n) of what makes none of `some` effects doubtful where it is left.

    By another law of what it goes by each is the same effect; the others may be of another form, and the
    friction of another shape.
    """
    own = [fitter.variants(chosen, i) for i in some]
    return np.concatenate([_forms_beside(fitter, chosen, some), *own])


def _forms_beside(fitter: Fitter, chosen: Fitted, some: Sequence[int]) -> Floats:
    """Return the columns (q, n) of other forms of what stands beside `some` effects, friction among it."""
    others = [fitter.forms_of(chosen, i) for i in range(len(chosen.terms)) if i not in some]
    return np.concatenate([fitter.other_friction(chosen), *others])


def _of_the_force(fitter: Fitter, rest: Fitted, without: Fitted, null: Null | None) -> float:
    """Return the part of the force that is left of what there is `without` an effect, squared."""
    noise, louder = null.noise if null is not None else math.inf, fitter.louder(rest)
    left, there = (fitter.above_noise(model, louder, noise) ** 2 for model in (rest, without))
    beyond = max(1.0 - noise / max(float(rest.errors.sum()), 1e-300), 0.0) if null is not None else 1.0
    return left * beyond / max(there, 1e-300)


def _as_weighed(fitter: Fitter, rest: Fitted, without: Fitted, null: Null | None) -> float:
    """Return the part of the squared residual that is left of what there is `without` an effect."""
    noise = null.noise if null is not None else 0.0
    left, there = (float(np.sum(model.residual[fitter.rows] ** 2)) - noise for model in (rest, without))
    return max(left, 0.0) / max(there, 1e-300)
