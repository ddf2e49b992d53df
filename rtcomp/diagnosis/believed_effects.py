"""Numbers of effects that the stage is believed to have: other values of them may be all that is missing.

A wave along the way that is a tenth larger than believed, or a Stribeck rise that is half as large, leaves
what looks like physics. As with mass and damping, other values of what is believed come before a name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.accept import ABOVE_FLOOR, worth_it
from rtcomp.diagnosis.addition import settle
from rtcomp.diagnosis.base import Fitted, fit_base
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.certain import MOVED, intervals, neighbours
from rtcomp.diagnosis.ledger import BIASES
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.refine import Refined, knobs_of, refine
from rtcomp.diagnosis.result import Retuned, Value
from rtcomp.diagnosis.scene import Entry
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import catalogue
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis

MOST_OF_IT = 0.5
"""Part of the excess over the floor that other numbers must explain."""
AS_WELL = 1.1
"""Times the error with names that other numbers may leave, to be preferred to them."""


@dataclass(frozen=True)
class Parted:
    """A stage without those of its effects whose numbers can be turned, and these as entries."""

    bare: Stage
    known: list[Entry]

    @classmethod
    def of(cls, stage: Stage, motion: Motion) -> Parted:
        """Take `stage` apart; a bias stays in it, being a number of the base."""
        effects = [dict(e) for e in stage.mechanics.effects]
        known = [e for e in effects if e["name"] not in BIASES and knobs_of([e], motion)]
        others = [e for e in effects if e not in known]
        return cls(_with_effects(stage, others), known)

    def whole(self, known: Sequence[Entry]) -> Stage:
        """Return the stage with these in the place of the believed ones."""
        return _with_effects(self.bare, [*self.bare.mechanics.effects, *known])

    def refined(self, motion: Motion, fitted: Fitted, entries: Sequence[Entry]) -> Refined:
        """Refine the effects taken out, and `entries` beside them, on the reaches of `fitted`."""
        every = [*self.known, *entries]
        base = fit_base(self.bare, motion, [effect_of(e) for e in every], (fitted.scale,))
        return refine(base, motion, every)


def _with_effects(stage: Stage, effects: Sequence[Entry]) -> Stage:
    data = stage.to_dict()
    data["stage"].pop("effects", None)
    if effects:
        data["stage"]["effects"] = [dict(e) for e in effects]
    return Stage.from_dict(data)


def other_numbers(
    stage: Stage, motion: Motion, final: Fitted, named: Sequence[Entry], floor: Floats
) -> Stage | None:
    """Return `stage` with other numbers of its effects, where these explain as much as what was `named`.

    `final` is the fit with the names, `floor` the squared error (N^2) of every seen block if nothing is
    missing. What is named and believed already may only be a believed one of another size, and is left out.
    """
    parted = Parted.of(stage, motion)
    if not parted.known:
        return None
    believed = {str(e["name"]) for e in parted.known}
    others = [e for e in named if e["name"] not in believed]
    try:
        before = final.errors
        if len(others) < len(named):
            base = fit_base(stage, motion, [effect_of(e) for e in others], (final.scale,))
            before = refine(base, motion, others).errors
        if before.sum() < ABOVE_FLOOR * floor.sum():
            return None
        found = settle(parted.bare, motion, parted.refined(motion, final, others))
    except (ConfigError, np.linalg.LinAlgError):
        return None
    left, excess = float(found.errors.sum()), float(before.sum() - floor.sum())
    if not worth_it(before, found.errors, floor) or float(before.sum()) - left < MOST_OF_IT * excess:
        return None
    if left > max(AS_WELL * float(final.errors.sum()), ABOVE_FLOOR * float(floor.sum())):
        return None
    return parted.whole(found.entries[: len(parted.known)])


def numbers_moved(
    believed: Stage, tuned: Stage, motion: Motion, refined: Refined, worse: float
) -> list[Retuned]:
    """Return the numbers of believed effects that `tuned` has otherwise, with their 95 % intervals.

    `refined` has the names found beside them; `worse` widens the intervals (`certain.birge`).
    """
    before, now = Parted.of(believed, motion), Parted.of(tuned, motion)
    again = now.refined(motion, refined.fitted, refined.entries)
    spans = intervals(again, neighbours(now.bare, motion, again), worse)
    found = []
    for at, (was, entry) in enumerate(zip(before.known, now.known, strict=True)):
        for p in catalogue.entry(str(entry["name"])).parameters:
            if (at, p.name) not in spans:
                continue
            old, new = float(was[p.name]), float(entry[p.name])  # type: ignore[arg-type]
            shift = new - float(again.entries[at][p.name])  # type: ignore[arg-type]
            low, high = (side + shift for side in spans[at, p.name])
            size = 1.0 if p.name == "phase" else abs(old)
            if abs(new - old) > MOVED * size and not low <= old <= high:
                value = Value(new, low, high, for_axis(p.unit, believed.axis))
                found.append(Retuned(f"{entry['name']}.{p.name}", old, value))
    return found
