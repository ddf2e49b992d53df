"""The search: forward with a full refit, a few models kept at a time, backward after each step."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.baseline import settle
from rtcomp.diagnosis.candidates import Candidate, candidates, started
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fit import Fitter
from rtcomp.diagnosis.fitted import Fitted
from rtcomp.diagnosis.free import Term
from rtcomp.diagnosis.intervals import told
from rtcomp.diagnosis.replicates import best, free_columns, null_of
from rtcomp.diagnosis.screening import Screen, Screened
from rtcomp.diagnosis.settings import BEAM, FULL_FITS, LEAST_GAIN, LEVEL, MOST_EFFECTS, NEGLIGIBLE
from rtcomp.diagnosis.significance import Null, log_gain
from rtcomp.errors import ConfigError

SCANNED = 14
"""Values of a length that are tried where first order is no guide."""

PLAINER = 1e-3
"""Logarithm of the error that one parameter more must gain to count at all."""
NEAR = 1.0
"""Logarithm of the error over the best one's, up to which a model is kept as an alternative."""

Say = Callable[[float, str], None]


@dataclass
class Search:
    """What the search did: models by number of effects, nulls, what it had no time for."""

    baseline: Fitted
    chosen: Fitted
    null: Null | None = None
    """Of the chosen model."""
    beside: list[Candidate] | None = None
    """All candidates beside the chosen model, where they were looked at."""
    alternatives: list[Fitted] = field(default_factory=list)
    """Models with one entry of the chosen one replaced by another effect."""
    screened: list[tuple[str, float, float]] = field(default_factory=list)
    """Name, gain and p-value of each candidate beside the baseline."""
    not_tried: list[str] = field(default_factory=list)
    dropped: list[str] = field(default_factory=list)
    """What was found and not kept, and why."""
    doubted: bool = False
    """Whether the search ended because its objective was doubted."""


def search(
    fitter: Fitter,
    baseline: Fitted,
    ends: float,
    say: Say,
    seed: int = 0,
    doubted: Callable[[Fitted], bool] | None = None,
    first: Look | None = None,
) -> Search:
    """Return the best model that the one test accepts; stops at the time `ends` (time.monotonic).

    Stops too where the objective itself is `doubted` because of the best model so far. `first` is the look at
    all candidates beside the baseline, where there was one.
    """
    found = Search(baseline, baseline)
    everything = float(baseline.errors.sum())
    beam, parents = [baseline], {id(baseline): math.inf}
    grown: list[Fitted] = []
    for step in range(MOST_EFFECTS + 1):
        judged = None
        while beam and judged is None:
            late = step > 0 and time.monotonic() > ends
            at_hand = first if step == 0 else None
            seen = _judged(fitter, beam[0], seed + step, say, at_hand, late=late)
            judged = _sound(seen, parents[id(beam[0])])
            if judged is None:
                beam.pop(0)
        if judged is None or judged.null is None:
            break
        null = judged.null
        found.chosen, found.null, found.beside = beam[0], null, judged.candidates or None
        found.alternatives = [g for g in grown if len(g.terms) == len(beam[0].terms) and g is not beam[0]]
        if step == 0:
            found.screened = _table(judged.candidates, judged.screened, null)
        done = null.settled(judged.gain, float(beam[0].errors.sum()), LEVEL)
        if done or step == MOST_EFFECTS or _exhausted(fitter, beam[0], everything):
            break
        if time.monotonic() > ends:
            found.not_tried.append(_further(found.chosen))
            break
        began = time.monotonic()
        grown = _grow(fitter, beam[0], judged.candidates, judged.screened, ends)
        short = time.monotonic() > ends
        for other in beam[1:] if null.p_value(judged.gain) < LEVEL else []:
            # Another is begun only where one that takes as long would end in time.
            moment = time.monotonic()
            short = short or 2.0 * moment - began > ends
            if short:
                break
            began = moment
            beside = look(fitter, other)
            grown += _grow(fitter, other, beside.candidates, beside.screened, ends)
        if short:
            found.not_tried.append(f"some of {_further(found.chosen)}")
        accepted = [g for g in grown if _accepted(fitter, g, _parent(g, beam), null, everything)]
        accepted = _distinct(sorted(accepted, key=_score))[:BEAM]
        parents = {}
        next_beam = []
        for model in accepted:
            smaller = _pruned(fitter, model, null, everything, ends)
            parents[id(smaller)] = float(_parent(model, beam).errors.sum())
            next_beam.append(smaller)
        beam = [m for m in _distinct(sorted(next_beam, key=_score)) if _score(m) < _score(found.chosen)]
        if not beam:
            break
        if time.monotonic() < ends:
            beam, grown = _resettled(fitter, found, beam, grown, parents)
            everything = float(found.baseline.errors.sum())
        if doubted is not None and doubted(beam[0]):
            found.doubted = True
            break
    _solid(fitter, found)
    return found


def _further(model: Fitted) -> str:
    return f"all further effects beside {' and '.join(ent.names(model.entries)) or 'the belief'}"


def _solid(fitter: Fitter, found: Search) -> None:
    """Leave out effects that are no finding, and refit the others."""
    while found.chosen.terms:
        weak = [(i, why) for i, why in enumerate(doubts(fitter, found)) if why]
        if not weak:
            return
        at, why = weak[-1]
        found.dropped.append(f"{ent.names(found.chosen.entries)[at]} is not named: {why}")
        kept = [t for i, t in enumerate(found.chosen.terms) if i != at]
        found.chosen, found.alternatives, found.beside = fitter.fit(kept, found.chosen), [], None


def doubts(fitter: Fitter, found: Search) -> list[str]:
    """Return why each effect of the chosen model is no finding, "" where it is one.

    Its size may be nothing, a number of it is at a physical bound, or more is left than it explains: what
    else makes the rest makes that part as well, more likely than not.
    """
    chosen, null = found.chosen, found.null
    said = []
    for i, span in enumerate(told(fitter, chosen)):
        why = "its size may be nothing" if span.nothing else ""
        why = f"{', '.join(span.bound)} at its bound" if span.bound else why
        if not why and null is not None and null.p_of_error(float(chosen.errors.sum())) < LEVEL:
            without = fitter.fit([*chosen.terms[:i], *chosen.terms[i + 1 :]], chosen)
            left = fitter.above_noise(chosen) ** 2
            explained = fitter.above_noise(without) ** 2 - left
            why = "more is left than it explains" if left > explained else ""
        said.append(why)
    return said


def _resettled(
    fitter: Fitter, found: Search, beam: list[Fitted], grown: list[Fitted], parents: dict[int, float]
) -> tuple[list[Fitted], list[Fitted]]:
    """Refit all on yield displacements that suit the best model: those of a poorer one were bent to it.

    Of the models that were `grown`, those that come near the best.
    """
    settle(fitter, beam[0].terms)
    found.baseline = fitter.fit([])
    again = [fitter.fit(m.terms, m) for m in beam]
    parents.update({id(new): parents[id(old)] for new, old in zip(again, beam, strict=True)})
    near = [g for g in sorted(grown, key=_score) if all(g is not m for m in beam)]
    near = [g for g in near if _score(g) < _score(beam[0]) + NEAR][:BEAM]
    return sorted(again, key=_score), [*again, *(fitter.fit(g.terms, g) for g in near)]


@dataclass(frozen=True)
class Look:
    """All candidates beside a model, their gains, the null distribution where it was asked for."""

    candidates: list[Candidate]
    screened: list[Screened]
    screen: Screen
    null: Null | None

    @property
    def gain(self) -> float:
        """The largest gain, 0 where no candidate was looked at."""
        return max((s.gain for s in self.screened), default=0.0)


def look(fitter: Fitter, model: Fitted) -> Look:
    """Look at all candidates beside a model, without their null distribution."""
    made = candidates(fitter, model, ent.names(model.entries))
    screen = Screen(made, fitter.block, fitter.blocks, fitter.use)
    return Look(made, screen.gains(free_columns(model), model.residual), screen, None)


def _judged(fitter: Fitter, model: Fitted, seed: int, say: Say, first: Look | None, *, late: bool) -> Look:
    """Return the look beside a model with its null distribution.

    `first` is that look, where it was taken before; where it is too `late` for one, only what chance leaves
    is looked at.
    """
    names = ent.names(model.entries)
    what = f"beside {' and '.join(names)}" if names else "search"
    say(0.0, what)
    if late:
        first = Look([], [], Screen([], fitter.block, fitter.blocks, fitter.use), None)
    seen = first or look(fitter, model)
    say(0.5, what)
    return replace(seen, null=null_of(fitter, model, seen.screen, seen.gain, seed))


def _sound(seen: Look, parent: float) -> Look | None:
    """Return what was seen where its model can be judged.

    A model that explains recordings of its own no better than the one before explains the real recording has
    shown nothing: it put the drive's force on both sides of the balance.
    """
    if seen.null is not None and float(np.median(seen.null.errors)) > parent:
        return None
    return seen


def _grow(
    fitter: Fitter, model: Fitted, made: Sequence[Candidate], screened: Sequence[Screened], ends: float
) -> list[Fitted]:
    """Return the model with each of the best candidates, fitted in full."""
    order = best([c.family for c in made], [s.gain for s in screened], len(made))
    terms = fitter.rough(model, [started(made[i], screened[i].sizes) for i in order], FULL_FITS, ends)
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


def _accepted(fitter: Fitter, model: Fitted, parent: Fitted, null: Null | None, everything: float) -> bool:
    """Tell whether the last effect of a model passes the one test and matters."""
    if null is None or model.at_bound:
        return False
    p = null.p_value(log_gain(parent.errors, model.errors))
    gained = math.sqrt(parent.errors.sum()) - math.sqrt(model.errors.sum())
    if p >= LEVEL or gained <= LEAST_GAIN * math.sqrt(everything):
        return False
    return fitter.relative(parent) ** 2 - fitter.relative(model) ** 2 > NEGLIGIBLE**2


def _exhausted(fitter: Fitter, model: Fitted, everything: float) -> bool:
    """Tell whether a model leaves too little for any further effect to matter."""
    little = math.sqrt(model.errors.sum()) <= LEAST_GAIN * math.sqrt(everything)
    return little or fitter.relative(model) <= NEGLIGIBLE


def _parent(model: Fitted, beam: Sequence[Fitted]) -> Fitted:
    names = ent.names(model.entries)[:-1]
    return next(b for b in beam if ent.names(b.entries) == names)


def _pruned(fitter: Fitter, model: Fitted, null: Null | None, everything: float, ends: float) -> Fitted:
    """Return the model without effects that no longer pass the test beside the others."""
    while len(model.terms) > 1 and time.monotonic() < ends:
        smaller = [
            fitter.fit([*model.terms[:i], *model.terms[i + 1 :]], model) for i in range(len(model.terms))
        ]
        rest = [s for s in smaller if not _accepted(fitter, model, s, null, everything)]
        if not rest:
            return model
        model = min(rest, key=_score)
    return model


def _score(model: Fitted) -> float:
    """Return the logarithm of the error left out; of models that are alike, the plainer comes first."""
    return float(np.mean(np.log(model.errors))) + PLAINER * model.size


def _distinct(models: Sequence[Fitted]) -> list[Fitted]:
    found: list[Fitted] = []
    for m in models:
        if all(sorted(ent.names(m.entries)) != sorted(ent.names(f.entries)) for f in found):
            found.append(m)
    return found


def _table(
    made: Sequence[Candidate], screened: Sequence[Screened], null: Null | None
) -> list[tuple[str, float, float]]:
    order = best([c.name for c in made], [s.gain for s in screened], len(made))
    return [
        (made[i].name, screened[i].gain, null.p_value(screened[i].gain) if null else float("nan"))
        for i in order
    ]


__all__ = ["Look", "Search", "Term", "doubts", "look", "search"]
