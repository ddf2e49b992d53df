"""The search: forward with a full refit, a few models kept at a time, backward after each step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.effects import Candidate
from rtcomp.diagnosis.candidates.screening import Look, Screen, Screened, look
from rtcomp.diagnosis.fitting.baseline import settle, yielding_later
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.law import SETTLED
from rtcomp.diagnosis.fitting.stage_of import bias_entry
from rtcomp.diagnosis.numerics.significance import Null
from rtcomp.diagnosis.search.acceptance import accepted, doubts, exhausted, pruned, score
from rtcomp.diagnosis.search.beam import (
    NEAR,
    beats,
    distinct,
    grown_from,
    grown_further,
    in_other_forms,
    refitted,
    shown_by_more_than_fitting,
    with_two,
)
from rtcomp.diagnosis.search.by_position import by_plain_laws
from rtcomp.diagnosis.search.replicates import best, null_of
from rtcomp.diagnosis.settings import BEAM, LEAST_GAIN, LEVEL, MOST_EFFECTS

LOOKED = 0.5
"""Part of the time left in which candidates are looked at; the rest is for those that are fitted in full."""

Say = Callable[[float, str], None]


@dataclass
class Search:
    """What the search did: models by number of effects, nulls, what it had no time for."""

    baseline: Fitted
    chosen: Fitted
    null: Null | None = None
    """Of the chosen model, as it was when its replicates were made."""
    replicated: Fitted | None = None
    """That model."""
    nulls: dict[tuple[str, ...], Null] = field(default_factory=dict)
    """Null distributions of the models of all steps, by the names of their effects in order."""
    beside: list[Candidate] | None = None
    """All candidates beside the chosen model, where they were looked at."""
    alternatives: list[Fitted] = field(default_factory=list)
    """Models with one entry of the chosen one replaced by another effect."""
    screened: list[tuple[str, float, float]] = field(default_factory=list)
    """Name, gain and p-value of each candidate beside the baseline."""
    cut: bool = False
    """Whether there was no time to look at all candidates, so that the null is of a few of them."""
    not_tried: list[str] = field(default_factory=list)
    dropped: list[str] = field(default_factory=list)
    """What was found and not kept, and why."""
    cut_short: bool = False
    """Whether time ended beside the belief alone, though the test does not say that no effect is missing."""
    doubted: bool = False
    """Whether the search ended because its objective was doubted."""
    denied: bool = False
    """Whether an effect was left out because the other objective does not show it."""
    laws: tuple[float, ...] = ()
    """Laws of friction (exponents) that all was begun with."""
    elsewhere: bool = False
    """Whether friction is settled on another model than the chosen one."""
    as_believed: bool = False
    """Whether the belief, as it is, leaves as much of recordings of its own: then no number of it moved."""


def search(
    fitter: Fitter,
    baseline: Fitted,
    ends: float,
    say: Say,
    seed: int = 0,
    doubted: Callable[[Fitted], bool] | None = None,
    first: Look | None = None,
) -> Search:
    """Return the best model that the one test accepts; stops at the time `ends` (clock.now).

    Stops too where the objective itself is `doubted` because of the best model so far. `first` is the look at
    all candidates beside the baseline, where there was one.
    """
    found = Search(baseline, baseline, laws=(fitter.balance.exponent,))
    everything, short = float(baseline.errors.sum()), False
    beam, parents = [baseline], {id(baseline): math.inf}
    grown: list[Fitted] = []
    passed: list[Fitted] = []
    alone: Look | None = None
    for step in range(MOST_EFFECTS + 1):
        judged = None
        while beam and judged is None:
            late = step > 0 and clock.now() > ends
            at_hand = first if step == 0 else None
            known = found.beside if fitter.by_force else None
            seen = _judged(fitter, beam[0], everything, seed + step, say, at_hand, known, ends, late=late)
            judged = sound(seen, beam[0], parents[id(beam[0])], found)
            if judged is None:
                grown = _of_other_effects(grown, beam.pop(0))  # nor does it stand in for what is judged
        if judged is None or judged.null is None:
            break
        null = judged.null
        alone = judged if not beam[0].terms or alone is None else alone
        before = replace(found)
        found.chosen = found.replicated = beam[0]
        found.null, found.beside = null, judged.candidates or None
        found.nulls[_effects_of(beam[0])] = null
        found.elsewhere, found.cut = False, judged.cut
        found.alternatives = [g for g in grown if len(g.terms) == len(beam[0].terms) and g is not beam[0]]
        _skipped(found, judged.cut)
        if step == 0:
            found.screened = _table(judged.candidates, judged.screened, null)
        done = null.settled(judged.gain, beam[0].errors, LEVEL)
        if done or step == MOST_EFFECTS or exhausted(fitter, beam[0], everything):
            break
        if clock.now() > ends:
            if short:  # of a step that was cut, only a model that leaves nothing is sure
                found = replace(before, not_tried=found.not_tried)
            else:
                found.not_tried.append(_further(found.chosen))
            break
        grown, short = grown_further(fitter, beam, judged, alone, ends)
        grown += in_other_forms(fitter, found.chosen, found.alternatives, grown, ends)
        fit = [g for g in grown if accepted(fitter, g, grown_from(g, beam), null, everything)]
        if not fit:
            grown += (pairs := with_two(fitter, beam[0], judged, grown, ends))
            fit = [g for g in pairs if accepted(fitter, g, beam[0], null, everything)]
        _skipped(found, short or clock.now() > ends)
        good = distinct(sorted(fit, key=score))[:BEAM]
        smaller = [pruned(fitter, model, passed, null, everything, ends) for model in good]
        parents = {id(s): float(grown_from(m, beam).errors.sum()) for s, m in zip(smaller, good, strict=True)}
        passed += good
        beam = distinct(sorted(smaller, key=score))
        beam = [m for m in beam if beats(fitter, m, found.chosen, null, everything)]
        beam = shown_by_more_than_fitting(beam, found.chosen, null, ends)
        if not beam:
            break
        if clock.now() < ends:
            beam, grown = _resettled(fitter, found, beam, grown, parents, null, ends)
            everything = float(found.baseline.errors.sum())
        if doubted is not None and beam and doubted(beam[0]):
            found.doubted = True
            break
    found.cut_short = _cut_short(fitter, found, alone, everything)
    if found.elsewhere:
        _settled_on_chosen(fitter, found)
    if fitter.offset and found.chosen.terms:
        _offset_judged(fitter, found)
    _solid(fitter, found)
    return found


def _cut_short(fitter: Fitter, found: Search, alone: Look | None, everything: float) -> bool:
    """Tell whether a look `alone` beside the belief leaves open that an effect is missing, and time ended."""
    if not found.not_tried or found.chosen.terms or alone is None or alone.null is None:
        return False
    may_be = not alone.screened or alone.null.p_value(alone.gain) < LEVEL
    return may_be and not exhausted(fitter, found.chosen, everything)


def _skipped(found: Search, cut: bool) -> None:
    """Say that some effects beside the chosen model were not tried, where time `cut` them off."""
    what = f"some of {_further(found.chosen)}"
    if cut and what not in found.not_tried:
        found.not_tried.append(what)


def _further(model: Fitted) -> str:
    return f"all further effects beside {' and '.join(ent.names(model.entries)) or 'the belief'}"


def _offset_judged(fitter: Fitter, found: Search) -> None:
    """Name the constant force that stood beside all models, where it passes the test beside the chosen one.

    Beside the belief alone it may be little of what there is, and beside what explains the rest much.
    """
    fitter.offset = False
    baseline, without = fitter.fit([]), fitter.fit(found.chosen.terms, found.chosen)
    named = fitter.fit([*found.chosen.terms, Term.of(bias_entry(1.0))], found.chosen)
    passed = accepted(fitter, named, without, found.null, float(baseline.errors.sum()))
    if not passed or doubts(fitter, named, found.null)[-1].why:
        fitter.offset = True  # it stays what stands beside every model
        return
    found.baseline, found.chosen, found.alternatives, found.beside = baseline, named, [], None


def _solid(fitter: Fitter, found: Search) -> None:
    """Leave out effects that are no finding, the most doubtful first, and refit the others.

    What is shown to be a smooth function of the position, and no more, is asked by the plainest name for it.
    """
    plainly = by_plain_laws(fitter, found.chosen, found.null)
    if plainly is not found.chosen:
        found.alternatives, found.beside = [*found.alternatives, found.chosen], None
        found.chosen = plainly
    while found.chosen.terms:
        doubted = doubts(fitter, found.chosen, found.null)
        weak = [i for i, doubt in enumerate(doubted) if doubt.why]
        if not weak:
            return
        at = max(weak, key=lambda i: doubted[i].left)
        found.denied |= doubted[at].denied
        gone = doubted[at].together or (at,)
        names = ", ".join(ent.names(found.chosen.entries)[i] for i in gone)
        found.dropped.append(f"{names} {'are' if len(gone) > 1 else 'is'} not named: {doubted[at].why}")
        kept = [t for i, t in enumerate(found.chosen.terms) if i not in gone]
        found.chosen, found.alternatives, found.beside = fitter.fit(kept, found.chosen), [], None
        # What is left is judged by replicates of the model that leaves it.
        found.null = found.nulls.get(_effects_of(found.chosen), found.null)


def _effects_of(model: Fitted) -> tuple[str, ...]:
    return tuple(sorted(ent.names(model.entries)))


def _of_other_effects(models: Sequence[Fitted], one: Fitted) -> list[Fitted]:
    return [m for m in models if _effects_of(m) != _effects_of(one)]


def _settled_on_chosen(fitter: Fitter, found: Search) -> None:
    """Refit the chosen model after friction was settled on one that was not kept: numbers of units moved."""
    settle(fitter, found.chosen.terms)
    found.baseline = fitter.fit([])
    found.chosen = fitter.fit(found.chosen.terms, found.chosen)
    found.alternatives = refitted(fitter, found.alternatives)


def _new_law(fitter: Fitter, found: Search) -> bool:
    """Tell whether friction yields by a law that nothing was begun with yet."""
    return all(abs(fitter.balance.exponent - law) > SETTLED for law in found.laws)


def _begun_again(fitter: Fitter, found: Search, parents: dict[int, float], ends: float) -> list[Fitted]:
    """Return the belief, fitted with the friction that it is to have from now on."""
    settle(fitter, (), ends, law=False)
    found.laws += (fitter.balance.exponent,)
    found.baseline = fitter.fit([])
    parents[id(found.baseline)], found.beside, found.elsewhere = math.inf, None, False
    return [found.baseline]


def _resettled(
    fitter: Fitter,
    found: Search,
    beam: list[Fitted],
    grown: list[Fitted],
    parents: dict[int, float],
    null: Null,
    ends: float,
) -> tuple[list[Fitted], list[Fitted]]:
    """Refit all on yield displacements that suit the best model: those of a poorer one were bent to it.

    Of the models that were `grown`, those that come near the best. Its own numbers and form were bent as
    well: both are settled in turn, as long as the error falls. What only made up for that is left out again.
    Where friction yields by a law that nothing was begun with yet, only the belief is returned: all begins
    beside that. So it does where friction that yields later explains more than the last effect.
    """
    later = yielding_later(fitter, found.chosen)
    if later is not None and score(later.fit(found.chosen.terms)) < score(beam[0]):
        fitter.balance.coarse = later.balance.coarse
        return _begun_again(fitter, found, parents, ends), []
    near = [g for g in sorted(grown, key=score) if all(g is not m for m in beam)]
    near = [g for g in near if score(g) < score(beam[0]) + NEAR][:BEAM]
    best, left, found.elsewhere = beam[0], math.inf, True
    others = [g for g in near if ent.names(g.entries) == ent.names(best.entries)]  # its other forms
    while best.sse < (1.0 - LEAST_GAIN) ** 2 * left and clock.now() < ends:
        once, left = left == math.inf, best.sse
        settle(fitter, best.terms, ends, law=once)
        if _new_law(fitter, found):
            return _begun_again(fitter, found, parents, ends), []
        best, *others = sorted(refitted(fitter, [best, *others]), key=lambda m: (m.at_bound, m.sse))
    found.baseline = fitter.fit([])
    again = [best, *refitted(fitter, beam[1:])]
    parents.update({id(new): parents[id(old)] for new, old in zip(again, beam, strict=True)})
    # On its own friction an effect may go to a bound that it kept away from on a poorer one.
    order = sorted(again, key=lambda m: (m.at_bound, score(m)))
    everything = float(found.baseline.errors.sum())
    first = pruned(fitter, order[0], (), null, everything, ends)
    parents[id(first)] = parents[id(order[0])]
    kept = [m for m in (first, *order[1:]) if beats(fitter, m, found.chosen, null, everything)]
    return kept, [*again, *refitted(fitter, near)]


def _judged(
    fitter: Fitter,
    model: Fitted,
    everything: float,
    seed: int,
    say: Say,
    first: Look | None,
    known: Sequence[Candidate] | None,
    ends: float,
    *,
    late: bool,
) -> Look:
    """Return the look beside a model with its null distribution, in a part of the time up to `ends`.

    `first` is that look, where it was taken before; `known` are candidates beside a smaller model. Where it
    is too `late` for one, only what chance leaves is looked at. Where a model leaves too little of
    `everything` for any further effect to matter, a few replicates do, whatever they show.
    """
    names = ent.names(model.entries)
    what = f"beside {' and '.join(names)}" if names else "search"
    say(0.0, what)
    if late:
        first = Look([], [], Screen([], fitter), None)
    looked = clock.until(ends, LOOKED)
    seen = first or look(fitter, model, looked, known)
    say(0.5, what)
    if exhausted(fitter, model, everything):
        ends = -math.inf
    return replace(seen, null=null_of(fitter, model, seen.screen, seen.gain, seed, looked, ends))


def sound(seen: Look, model: Fitted, parent: float, before: Search) -> Look | None:
    """Return what was seen beside a model where it can be judged, after a step `before` it.

    A model that explains recordings of its own no better than the one before explains the real recording has
    shown nothing: it put the drive's force on both sides of the balance. Nor has one that is further than
    that from what its own recordings leave: a lag with hardly any mass makes noise less, not the mismatch.
    Noise of a reading goes by the mass squared; what else is less beside a model is not noise.
    """
    if seen.null is None or seen.null.noise > parent:
        return seen if seen.null is None else None
    null, last, smaller = seen.null, before.null, before.chosen
    if last is None or last.numbers is None or null.numbers is None or null.p_of_error(model.errors) >= LEVEL:
        return seen
    lighter = min(float(model.coefficients[0] / smaller.coefficients[0]), 1.0)
    noise = max(null.noise, last.noise * lighter**2)
    further = model.errors.sum() / noise > smaller.errors.sum() / last.noise
    return None if further and len(model.terms) > len(smaller.terms) else seen


def _table(
    made: Sequence[Candidate], screened: Sequence[Screened], null: Null | None
) -> list[tuple[str, float, float]]:
    order = best([c.name for c in made], [s.gain for s in screened], len(made))
    return [
        (made[i].name, screened[i].gain, null.p_value(screened[i].gain) if null else float("nan"))
        for i in order
    ]
