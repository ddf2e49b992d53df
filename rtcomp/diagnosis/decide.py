"""Deciding: which entries are named, by what they explain of motion left out of the fit.

Forward with a full refit, each looked for again with the others at work, backward deletion. `accept` says
which entries count; the set of names is all that explain the same as well on this recording.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rtcomp.diagnosis.accept import (
    ABOVE_FLOOR,
    ELSE,
    NEAR,
    SETTLED,
    is_something_else,
    modelled,
    settles_the_rest,
    stands_out,
    worth_it,
)
from rtcomp.diagnosis.addition import Addition, Progress, best_addition, settle
from rtcomp.diagnosis.alike import APART, ONE_THING, SHAPELESS, alike, last
from rtcomp.diagnosis.base import Fitted
from rtcomp.diagnosis.double import Double
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.refine import Refined, refine
from rtcomp.diagnosis.scene import Entry
from rtcomp.diagnosis.screen import Screened
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

MOST = 4
"""Entries named at the most: beyond, a recording does not carry the decision."""
RIVAL, HALF = 0.7, 0.3
"""Part of the first entry's gain from which on another is tried in its place: in general, and in the place of
a free curve,"""
TOGETHER, SHAPED, SPARED = 0.6, 0.95, 1.25
"""and the part of the error with the first and its second that the other and its own must not exceed: in
general, in the place of a free curve, and there if they come down to the floor."""
RIVALS, HOPELESS = 2, 100.0
"""Others tried so at the most, and times the error with the first that they may leave alone."""
ONCE = 4.0
"""Times the floor of its stretch that is left where the sensor may have jumped, from which on it is looked
into."""
DONE = 3.0
"""Times the floor that two leave, below which no other two are tried."""
EXCHANGED = 0.93
"""Part of the error with one entry that must be left with another in its place, to take that one."""
ENOUGH, POOR = 0.7, 0.5
"""Part of the excess over the floor that names must explain together, else none is given: where what is left
depends clearly on something, and in any case."""


@dataclass
class Choice:
    """One accepted entry: the names that explain it alike, and what it explains."""

    names: list[str]
    probability: float
    gain: float


@dataclass
class Decision:
    """All accepted entries with the fit that has them, and every candidate's gain at the first look."""

    refined: Refined
    choices: list[Choice]
    base: Fitted
    first_look: list[Screened] = field(default_factory=list)
    first_refined: dict[str, float] = field(default_factory=dict)
    faint: bool = False
    """Whether the level of the error alone does not show that something is missing."""

    def left(self, floor: Floats) -> float:
        """Return the part of the excess over `floor` that the names leave, of the motion that was seen."""
        before, after = float(self.base.errors.sum()), float(self.refined.errors.sum())
        return 1.0 - (before - after) / max(before - float(floor.sum()), 1e-300)

    def abstain_if_poor(self, floor: Floats, still_structured: bool) -> None:
        """Take the names back where together they leave too much: the nearest name would be the wrong one."""
        after = float(self.refined.errors.sum())
        explained = 1.0 - self.left(floor)
        shapeless = all(c.names[0] in SHAPELESS for c in self.choices)
        enough = POOR if shapeless or not still_structured else ENOUGH
        if explained < enough and after > 6.0 * float(floor.sum()):
            self.choices = []


def decide(
    stage: Stage,
    motion: Motion,
    base: Fitted,
    floor: Floats,
    progress: Progress | None = None,
    without: frozenset[str] = frozenset(),
    looked_at: bool = False,
) -> Decision:
    """Name what is missing; `floor` is the squared error of every seen block if nothing were.

    Names in `without` are not considered. With `looked_at` it is looked for whatever the floor says: an
    entry may stand out of a level that does not.
    """
    entries: list[Entry] = []
    choices: list[Choice] = []
    current = base

    def part_of(step: int) -> Progress:
        def show(part: float, what: str) -> None:
            if progress is not None:
                progress((step + part) / MOST, what)

        return show

    refined = refine(base, motion, [])
    decision = Decision(refined, choices, base)
    ahead: Addition | None = None
    greedy: Refined | None = None
    free_curve: Refined | None = None
    for step in range(MOST):
        once = _once(motion, current, floor)
        if current.errors.sum() < ABOVE_FLOOR * floor.sum() and not (looked_at and not entries) and not once:
            break
        explained = modelled((str(e["name"]) for e in entries), (c.gain for c in choices))
        settled = bool(entries) and not once
        settled &= bool(current.errors.sum() - floor.sum() < SETTLED * explained)
        double = Double.of(stage, refined, motion, floor) if settled else None
        if settled and (double is None or current.errors.sum() < ELSE * double.errors.sum()):
            break
        added = ahead or best_addition(stage, motion, current, entries, part_of(step), without)
        ahead = None
        if step == 0:
            decision.first_look, decision.first_refined = added.looked, added.gains
            contenders = [r for r in (added.best, *added.others) if r is not None]
            free_curve = next((r for r in contenders if last(r) in SHAPELESS), None)
            greedy = added.best
            added, ahead = _look_ahead(stage, motion, current, added, floor, part_of(step), without)
        best = added.best
        together = step == 0 and best is not greedy
        if best is None:
            break
        near = step == 0 and current.errors.sum() < NEAR * floor.sum()
        shapeless = last(best) in SHAPELESS
        jumped = once and last(best) == "sensor-jump" and not _once(motion, best.fitted, floor)
        if not together and not jumped and not worth_it(current.errors, best.errors, floor):
            if step > 0 or shapeless or not stands_out(current.errors, best.errors):
                break
            decision.faint = True
        elif near and shapeless and not stands_out(current.errors, best.errors):
            break
        exact = sum(c.gain for c in choices) - explained
        before, after = current.errors, best.errors
        if entries and (settled or not settles_the_rest(explained, before, after, floor, shapeless, exact)):
            double = double or Double.of(stage, refined, motion, floor)
            if shapeless or double is None or not _is_something_else(double, before, best):
                break
        gained = float(current.errors.sum() - best.errors.sum())
        names, probability = alike(best, added.others, current, floor)
        choices.append(Choice(names, probability, gained))
        refined = best
        entries, current = refined.entries, refined.fitted
    if len(choices) > 1:
        refined = _exchange(stage, motion, refined, choices, floor, part_of(MOST - 1), without)
    refined, choices = _prune(stage, motion, refined, choices, floor)
    if free_curve is not None:
        refined, choices = _without_names(base, refined, choices, free_curve)
    refined = refine(refined.fitted, motion, refined.entries)
    first = {c.names[0] for c in choices}
    for choice in choices:
        choice.names[1:] = [n for n in choice.names[1:] if n not in first]
        choice.probability = choice.probability if len(choice.names) > 1 else 1.0
    decision.refined, decision.choices = refined, choices
    return decision


def _once(motion: Motion, current: Fitted, floor: Floats) -> bool:
    """Tell whether a stretch in which the sensor may have jumped is far off, whatever all are together."""
    seen = np.flatnonzero(current.ledger.seen)
    far = current.errors > ONCE * np.maximum(floor, floor.mean())
    return bool(far[np.isin(seen, list(motion.jumped))].any())


def _is_something_else(double: Double, before: Floats, best: Refined) -> bool:
    """Tell whether the last entry of `best` explains what the kernels of those before it do not leave."""
    return is_something_else(before, best.errors, double.errors, double.gain(best.entries[-1]))


def _look_ahead(
    stage: Stage,
    motion: Motion,
    base: Fitted,
    first: Addition,
    floor: Floats,
    progress: Progress,
    without: frozenset[str],
) -> tuple[Addition, Addition | None]:
    """Return the first entry that does best with a second beside it, and that second where it was looked for.

    Where two effects hide in each other the first one found had to do for both, and may be neither.
    """
    best = first.best
    enough = ABOVE_FLOOR * float(floor.sum())
    settled = best is not None and float(best.errors.sum()) < enough
    # A free curve explains waves as well as waves do, and names nothing.
    if best is None or (settled and last(best) not in SHAPELESS):
        return first, None
    gain = float(base.errors.sum() - best.errors.sum())
    group = next((set(g) for g in ONE_THING if last(best) in g), {last(best)})
    shapeless = last(best) in SHAPELESS
    most = (1.0 - (HALF if shapeless else RIVAL)) * gain + float(best.errors.sum())
    if not shapeless:
        most = min(most, HOPELESS * float(best.errors.sum()))
    rivals = [
        r
        for r in first.others
        if last(r) not in group and last(r) not in SHAPELESS and float(r.errors.sum()) < most
    ]
    if not rivals or not worth_it(base.errors, best.errors, floor):
        return first, None

    def beside(one: Refined) -> Addition:
        return best_addition(stage, motion, one.fitted, one.entries, progress, without)

    done = DONE * float(floor.sum())
    chosen, ahead, left = best, None, float(best.errors.sum())
    asked = settled
    if not asked and not shapeless:
        ahead, asked = beside(best), True
        left = float((ahead.best or best).errors.sum())
    for rival in rivals[:RIVALS]:
        if asked and left < done and last(chosen) not in SHAPELESS:
            break
        other = beside(rival)
        both = other.best
        if both is None or not worth_it(base.errors, both.errors, floor):
            continue
        alone = float(base.errors.sum() - rival.errors.sum())
        told = modelled([last(rival)], [alone])
        if not settles_the_rest(told, rival.errors, both.errors, floor, exact=alone - told):
            continue
        pair = float(both.errors.sum())
        if not asked and not (pair < done and last(both) not in SHAPELESS):
            # A free curve and what goes with it are asked for only where nothing with a name does for both.
            ahead, asked = beside(best), True
            left = float((ahead.best or best).errors.sum())
        if pair < _most_left(last(chosen), last(both), left, enough if asked else done):
            chosen, ahead, left, asked = rival, other, pair, True
    if not asked:
        ahead = beside(best)
    others = [best, *(r for r in first.others if r is not chosen)] if chosen is not best else first.others
    return replace(first, best=chosen, others=others), ahead


def _most_left(chosen: str, second: str, left: float, enough: float) -> float:
    """Return the error that another first entry must reach, with `second` beside it, to replace `chosen`.

    A free curve gives way to a name that does nearly as well, but not to one that needs the curve beside it.
    """
    spares = chosen in SHAPELESS and second not in SHAPELESS
    return max(SHAPED * left, min(enough, SPARED * left)) if spares else TOGETHER * left


def _exchange(
    stage: Stage,
    motion: Motion,
    refined: Refined,
    choices: list[Choice],
    floor: Floats,
    progress: Progress,
    without: frozenset[str],
) -> Refined:
    """Look for each entry again with the others at work: what was named first had to do for them as well."""
    as_found = True
    for at in range(len(choices)):
        if as_found and at == len(choices) - 1:
            break  # it was found beside these others
        others = [e for i, e in enumerate(refined.entries) if i != at]
        fewer = settle(stage, motion, refine(refined.fitted, motion, others, tries=3))
        added = best_addition(stage, motion, fewer.fitted, fewer.entries, progress, without)
        best = added.best
        if best is None:
            continue
        now = str(refined.entries[at]["name"])
        same = any({last(best), now} <= set(group) for group in ((now,), *ONE_THING))
        if not same and float(best.errors.sum()) > EXCHANGED * float(refined.errors.sum()):
            # What it was not told from alone may be told from it with the others at work.
            most = APART * float(refined.errors.sum())
            near = {last(r) for r in (best, *added.others) if float(r.errors.sum()) <= most}
            near |= {name for group in ONE_THING if now in group for name in group}
            choices[at].names[1:] = [n for n in choices[at].names[1:] if n in near]
            continue
        names, probability = alike(best, added.others, fewer.fitted, floor)
        gained = float(fewer.errors.sum() - best.errors.sum())
        if not same or float(best.errors.sum()) < float(refined.errors.sum()):
            as_found &= same and float(best.errors.sum()) > EXCHANGED * float(refined.errors.sum())
            refined = refine(best.fitted, motion, _moved(best.entries, at), tries=1)
        own = str(refined.entries[at]["name"])
        choices[at] = Choice([own, *(name for name in names if name != own)], probability, gained)
    return refined


def _moved(entries: list[Entry], to: int) -> list[Entry]:
    """Return the entries with the last one put in place `to`."""
    return [*entries[:to], entries[-1], *entries[to:-1]]


def _without_names(
    base: Fitted, refined: Refined, choices: list[Choice], free_curve: Refined
) -> tuple[Refined, list[Choice]]:
    """Return the `free_curve` alone where it is among the entries and does as well without their names."""
    beside = len(choices) > 1 and any(c.names[0] in SHAPELESS for c in choices)
    alone = float(free_curve.errors.sum())
    if not beside or SHAPED * alone > float(refined.errors.sum()):
        return refined, choices
    return free_curve, [Choice([last(free_curve)], 1.0, float(base.errors.sum()) - alone)]


def _prune(
    stage: Stage,
    motion: Motion,
    refined: Refined,
    choices: list[Choice],
    floor: Floats,
) -> tuple[Refined, list[Choice]]:
    """Delete every entry that the others make needless."""
    kept, chosen = refined, list(choices)
    at = 0
    while len(kept.entries) > 1 and at < len(kept.entries):
        without = [e for i, e in enumerate(kept.entries) if i != at]
        fewer = settle(stage, motion, refine(kept.fitted, motion, without, tries=3))
        if worth_it(fewer.errors, kept.errors, floor):
            at += 1
        else:
            kept = fewer
            del chosen[at]
    return kept, chosen
