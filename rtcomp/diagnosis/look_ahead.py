"""Looking one entry ahead: the first one may have had to do for two that hide in each other."""

from __future__ import annotations

from dataclasses import replace

from rtcomp.diagnosis.accept import ABOVE_FLOOR, modelled, settles_the_rest, worth_it
from rtcomp.diagnosis.addition import Addition, Progress, best_addition
from rtcomp.diagnosis.alike import ONE_THING, SHAPELESS, last
from rtcomp.diagnosis.base import Fitted
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.refine import Refined
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

RIVAL, HALF = 0.7, 0.3
"""Part of the first entry's gain from which on another is tried in its place: in general, and in the place of
a free curve,"""
TOGETHER, SHAPED, SPARED = 0.6, 0.95, 1.25
"""and the part of the error with the first and its second that the other and its own must not exceed: in
general, in the place of a free curve, and there if they come down to the floor."""
RIVALS, HOPELESS = 2, 100.0
"""Others tried so at the most, and times the error with the first that they may leave alone."""
DONE = 3.0
"""Times the floor that two leave, below which no other two are tried."""
HIDING, HIDDEN, BEHIND, TRIED = 0.8, 100.0, 0.35, 3
"""Part of the error that the first must explain, and times the floor that it and its second must leave, for
something large to be hidden behind it: then the gain of a rival may be this part of the first one's, and up
to so many are tried."""


def look_ahead(
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
    hopeless = HOPELESS * float(best.errors.sum())
    named = [r for r in first.others if last(r) not in group and last(r) not in SHAPELESS]

    def gaining(part: float) -> list[Refined]:
        most = (1.0 - part) * gain + float(best.errors.sum())
        return [r for r in named if float(r.errors.sum()) < (most if shapeless else min(most, hopeless))]

    rivals = gaining(HALF if shapeless else RIVAL)[:RIVALS]
    hidden = gaining(BEHIND)[:TRIED] if not shapeless and gain > HIDING * float(base.errors.sum()) else []
    hidden = hidden[len(rivals) :]
    if not (rivals or hidden) or not worth_it(base.errors, best.errors, floor):
        return first, None

    def beside(one: Refined) -> Addition:
        return best_addition(stage, motion, one.fitted, one.entries, progress, without)

    done = DONE * float(floor.sum())
    chosen, ahead, left = best, None, float(best.errors.sum())
    asked = settled
    if not asked and not shapeless:
        ahead, asked = beside(best), True
        left = float((ahead.best or best).errors.sum())
    for at, rival in enumerate((*rivals, *hidden)):
        bending = last(chosen) in SHAPELESS or _twice(chosen, ahead)
        if asked and left < done and not bending:
            break
        if at >= len(rivals) and left < HIDDEN * float(floor.sum()):
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
        bending = last(chosen) in SHAPELESS or _twice(chosen, ahead)
        if pair < most_left(bending, last(both), left, enough if asked else done):
            chosen, ahead, left, asked = rival, other, pair, True
    if not asked:
        ahead = beside(best)
    others = [best, *(r for r in first.others if r is not chosen)] if chosen is not best else first.others
    return replace(first, best=chosen, others=others), ahead


def _twice(first: Refined, ahead: Addition | None) -> bool:
    """Tell whether an entry has another of its name beside it: two waves bend to anything, as curves do."""
    return ahead is not None and ahead.best is not None and last(ahead.best) == last(first)


def most_left(bending: bool, second: str, left: float, enough: float) -> float:
    """Return the error that another first entry must reach, with `second` beside it, to replace the chosen.

    One that is `bending` to anything, a free curve or two waves, gives way to a name that does nearly as
    well, but not to one that needs a curve beside it.
    """
    spares = bending and second not in SHAPELESS
    return max(SHAPED * left, min(enough, SPARED * left)) if spares else TOGETHER * left
