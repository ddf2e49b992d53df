"""What counts beside names that were found: a further entry, a jump, a believed number further off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rtcomp.diagnosis.accept import ELSE, is_something_else, is_the_rest, settles_the_rest, worth_it
from rtcomp.diagnosis.addition import Addition, settle
from rtcomp.diagnosis.alike import SHAPELESS, last
from rtcomp.diagnosis.base import ENTRY_OF, Fitted
from rtcomp.diagnosis.double import Double
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.refine import Refined, refine
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

ONCE = 4.0
"""Times the floor of its stretch that is left where the sensor may have jumped, from which on it is looked
into."""
AS_MUCH = 0.75
"""Part of what a free curve explains beside names, that a further name must explain to be held against them
in its place."""


def further_entry(
    motion: Motion,
    current: Fitted,
    added: Addition,
    floor: Floats,
    explained: tuple[float, float] | None,
    double_of: Callable[[], Double | None],
) -> Refined | None:
    """Return what was `added` beside other entries if it counts; None where nothing does.

    A free curve trims anything: where it does not count, a name that does nearly as much may. `explained`
    is what those before explain, as far as their kernels leave something of it, and else; None where that
    settles all.
    """
    best, before = added.best, current.errors
    if best is None:
        return None
    offered = [best]
    if last(best) in SHAPELESS:
        least = AS_MUCH * float((before - best.errors).sum())
        names = (r for r in added.others if last(r) not in SHAPELESS)
        offered += [r for r in names if float((before - r.errors).sum()) > least][:1]
    for one in offered:
        shapeless = last(one) in SHAPELESS
        if not (jumped(motion, current, one, floor) or worth_it(before, one.errors, floor)):
            continue
        if explained and settles_the_rest(explained[0], before, one.errors, floor, shapeless, explained[1]):
            return one
        double = None if shapeless else double_of()
        if double is not None and _is_something_else(double, before, one):
            return one
    return None


def leaves_more(current: Fitted, double: Double | None) -> bool:
    """Tell whether more is left than the kernels at work leave of what they stand for."""
    return double is not None and bool(current.errors.sum() >= ELSE * double.errors.sum())


def may_have_jumped(motion: Motion, current: Fitted, floor: Floats) -> bool:
    """Tell whether a stretch in which the sensor may have jumped is far off, whatever all are together."""
    seen = np.flatnonzero(current.ledger.seen)
    far = current.errors > ONCE * np.maximum(floor, floor.mean())
    return bool(far[np.isin(seen, list(motion.jumped))].any())


def jumped(motion: Motion, before: Fitted, best: Refined, floor: Floats) -> bool:
    """Tell whether `best` adds a jump without which the stretch that has it stood out of the rest.

    The rest need not be right: what else is missing is looked for beside the jump.
    """
    if last(best) != "sensor-jump":
        return False
    after = best.fitted
    apart = np.isin(np.flatnonzero(after.ledger.seen), list(motion.jumped))
    rest = float(np.median(after.errors[~apart])) if not apart.all() else 0.0
    level = ONCE * np.maximum(np.maximum(floor, floor.mean()), rest)[apart]
    return bool((before.errors[apart] > level).any() and (after.errors[apart] <= level).all())


def further_off(stage: Stage, motion: Motion, alike: Sequence[Refined], floor: Floats) -> Refined | None:
    """Return the best of entries that are `alike`, best first, with believed numbers further off than usual.

    Those are numbers that go as far as they may: what is named beside one would have to do for it too. None
    where letting them further does not show.
    """
    found = [r for one in alike if (r := _let_go(stage, motion, one)) is not None]
    best = min(found, key=lambda r: float(r.errors.sum()), default=None)
    return best if best is not None and is_the_rest(alike[0].errors, best.errors, floor) else None


def _let_go(stage: Stage, motion: Motion, refined: Refined) -> Refined | None:
    """Return `refined` on numbers let go that went as far as they may; None where none did."""
    named = {str(e["name"]) for e in refined.entries}
    held = {n for n in refined.fitted.at_bounds if n in ENTRY_OF and ENTRY_OF[n] not in named}
    if not held:
        return None
    free = replace(refined.fitted, freed=refined.fitted.freed | held)
    return settle(stage, motion, refine(free, motion, refined.entries, tries=3))


def _is_something_else(double: Double, before: Floats, best: Refined) -> bool:
    """Tell whether the last entry of `best` explains what the kernels of those before it do not leave."""
    return is_something_else(before, best.errors, double.errors, double.gain(best.entries[-1]))
