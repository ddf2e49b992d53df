"""Deciding: which entries are named, by what they explain of motion left out of the fit.

Forward with a full refit, each looked for again with the others at work, backward deletion. `accept` says
which entries count; the set of names is all that explain the same as well on this recording.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, partial

from rtcomp.diagnosis.accept import (
    ABOVE_FLOOR,
    DISTINCT,
    NEAR,
    SETTLED,
    modelled,
    stands_out,
    worth_it,
)
from rtcomp.diagnosis.addition import Addition, Progress, best_addition, settle
from rtcomp.diagnosis.alike import APART, ONE_THING, SHAPELESS, alike, last
from rtcomp.diagnosis.base import Fitted
from rtcomp.diagnosis.double import Double
from rtcomp.diagnosis.further import further_entry, further_off, jumped, leaves_more, may_have_jumped
from rtcomp.diagnosis.lengths import left_out
from rtcomp.diagnosis.look_ahead import SHAPED, look_ahead
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.refine import Refined, refine
from rtcomp.diagnosis.scene import Entry
from rtcomp.diagnosis.screen import Screened
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

MOST = 4
"""Entries named at the most: beyond, a recording does not carry the decision."""
CHANCE = 0.35
"""Part of what an entry gains that it may gain on the double, where the level of the error shows little."""
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

    def put_first(self, name: str) -> None:
        """Give it the name at work: a further entry may have told it from the one that came first."""
        self.names = [name, *(n for n in self.names if n != name)]


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
    distinct: float | None = None,
    promising: Callable[[Refined], bool] | None = None,
) -> Decision:
    """Name what is missing; `floor` is the squared error of every seen block if nothing were.

    Names in `without` are not considered. With `distinct` it is looked for whatever the floor says: an
    entry may stand out of a level that does not, if it explains that part of it. Entries that are not
    `promising` are left as they were found, and not looked for again beside each other.
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
    rivals: list[Refined] = []
    for step in range(MOST):
        once = may_have_jumped(motion, current, floor)
        if current.errors.sum() < ABOVE_FLOOR * floor.sum() and (distinct is None or entries) and not once:
            break
        explained = modelled((str(e["name"]) for e in entries), (c.gain for c in choices))
        settled = bool(entries) and not once
        settled &= bool(current.errors.sum() - floor.sum() < SETTLED * explained)
        double_of = cache(partial(Double.of, stage, refined, motion, floor))
        if settled and not leaves_more(current, double_of()):
            break
        near = step == 0 and bool(current.errors.sum() < NEAR * floor.sum())
        added = ahead or best_addition(stage, motion, current, entries, part_of(step), without)
        ahead = None
        if step == 0:
            decision.first_look, decision.first_refined = added.looked, added.gains
            contenders = [r for r in (added.best, *added.others) if r is not None]
            free_curve = next((r for r in contenders if last(r) in SHAPELESS), None)
            greedy = added.best
            if near:
                added = _not_by_chance(added, current, Double.of(stage, refined, motion, floor))
            else:
                added, ahead = look_ahead(stage, motion, current, added, floor, part_of(step), without)
        best = added.best
        if entries:
            exact = sum(c.gain for c in choices) - explained
            best = further_entry(
                motion, current, added, floor, None if settled else (explained, exact), double_of
            )
        elif best is not None and (near or best is greedy):
            counts = jumped(motion, current, best, floor) or worth_it(current.errors, best.errors, floor)
            shown = stands_out(current.errors, best.errors, distinct or DISTINCT)
            shapeless = last(best) in SHAPELESS
            doubtful = (near and shapeless) or not counts
            if (doubtful and not shown) or (shapeless and not counts):
                break
            decision.faint = not counts
        if best is None:
            break
        gained = float(current.errors.sum() - best.errors.sum())
        names, probability = alike(best, added.others, current, floor)
        choices.append(Choice(names, probability, gained))
        rivals = [best, *(r for r in added.others if last(r) in names)]
        refined = best
        entries, current = refined.entries, refined.fitted
        for choice, entry in zip(choices, entries, strict=True):
            choice.put_first(str(entry["name"]))
    freed = further_off(stage, motion, rivals, floor) if rivals else None
    if freed is not None:
        refined = freed
        choices[-1].put_first(last(freed))
    if len(choices) > 1 and (promising is None or promising(refined)):
        refined = _exchange(
            stage, motion, refined, choices, floor, part_of(MOST - 1), without, as_found=freed is None
        )
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


def _not_by_chance(added: Addition, current: Fitted, double: Double | None) -> Addition:
    """Return what was found but for entries that gain much of it on the double too, where nothing of them is.

    Noise in what an entry goes by, command or position, is explained by the entry itself.
    """
    if added.best is None or double is None:
        return added
    found = [added.best, *added.others]
    gains = [float(current.errors.sum() - r.errors.sum()) for r in found]
    kept = [r for r, gain in zip(found, gains, strict=True) if double.gain(r.entries[-1]) < CHANCE * gain]
    return replace(added, best=kept[0] if kept else None, others=kept[1:])


def _exchange(
    stage: Stage,
    motion: Motion,
    refined: Refined,
    choices: list[Choice],
    floor: Floats,
    progress: Progress,
    without: frozenset[str],
    as_found: bool = True,
) -> Refined:
    """Look for each entry again with the others at work: what was named first had to do for them as well.

    `as_found` says that the base is still the one that the last of them was found on.
    """
    for at in range(len(choices)):
        if as_found and at == len(choices) - 1:
            break  # it was found beside these others
        others = left_out(refined.entries, at)
        fewer = settle(stage, motion, refine(refined.fitted, motion, others, tries=3))
        known = float(refined.errors.sum())
        added = best_addition(stage, motion, fewer.fitted, fewer.entries, progress, without, known)
        best = added.best
        if best is None:
            continue
        now = str(refined.entries[at]["name"])
        same = any({last(best), now} <= set(group) for group in ((now,), *ONE_THING))
        if not same and float(best.errors.sum()) > EXCHANGED * known:
            # What it was not told from alone may be told from it with the others at work.
            most = APART * known
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
        fewer = settle(stage, motion, refine(kept.fitted, motion, left_out(kept.entries, at), tries=3))
        if worth_it(fewer.errors, kept.errors, floor):
            at += 1
        else:
            kept = fewer
            del chosen[at]
    return kept, chosen
