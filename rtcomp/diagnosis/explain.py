"""An explanation: names decided on, put into the stage, and held against what was put aside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.accept import ABOVE_FLOOR, DISTINCT, MAINLY
from rtcomp.diagnosis.addition import Progress
from rtcomp.diagnosis.alike import SHAPELESS
from rtcomp.diagnosis.base import Fitted
from rtcomp.diagnosis.certain import may_be_nothing
from rtcomp.diagnosis.decide import Choice, Decision, decide
from rtcomp.diagnosis.departure import departure
from rtcomp.diagnosis.double import Double
from rtcomp.diagnosis.extend import extended_stage
from rtcomp.diagnosis.further import leaves_more
from rtcomp.diagnosis.held_out import HeldOut
from rtcomp.diagnosis.holding import does_harm, explains_little, holds, leaves_much, must_explain
from rtcomp.diagnosis.locate import locate
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.refine import Refined, consistent
from rtcomp.diagnosis.result import Fit
from rtcomp.diagnosis.scene import Entry
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

NEGLIGIBLE = 0.0035
"""Relative force error up to which only what explains most of it is looked for."""
CLEAR = 0.5
"""Part of the mismatch that depends on one axis, from which on it is looked into however small it is."""
STRUCTURED = 0.3
"""Part of the remaining mismatch that depends on one axis, from which on names are taken back."""
PROMISING = 0.4
"""Part of what was put aside that several names must explain, before they are looked for again beside
each other: that mends some, but not so much. Only where the floor is a double's."""
CONFIRMED = 0.92
"""Factor to which a name must bring the held-out error, in all or in the typical block, where the level of
the error shows nothing."""
STRAYED = 9.0
"""How much further (see `departure`) than half again the retuning names may take what is believed."""
AGAIN = 2
"""Times that names which do not hold are left out and others are looked for."""


@dataclass(frozen=True)
class Explanation:
    """What was decided, what of it is named, the stage that has it, how that does on what was put aside."""

    decision: Decision
    named: list[Entry]
    entries: list[Entry]
    """All that is at work in the fit, also what only changes a believed number."""
    stage: Stage
    final: Fitted
    fit: Fit


def explain(
    stage: Stage, motion: Motion, base: Fitted, floor: Floats, least: Floats, say: Progress, seed: int
) -> Explanation:
    """Say what `stage` leaves out; names that do not hold on what was put aside are not given.

    `floor` and `least` are squared errors (N^2) of seen blocks: left by noise and method, and worth a look.
    """
    retuned = extended_stage(stage, base, [])
    before, plain = HeldOut.of(stage, motion).error, HeldOut.of(retuned, motion)
    rest = float(np.sqrt(floor.sum() / _power(base)))
    faint, distinct = _to_look_for(motion, base, floor, least, seed)
    doubled = stage.controller is not None and all(s.reference is not None for s in motion.strips)

    def promising(refined: Refined) -> bool:
        together = consistent(refined)
        own = extended_stage(stage, together.fitted, together.entries)
        return not explains_little(Fit(before, plain.error, HeldOut.of(own, motion).error, rest), PROMISING)

    without: frozenset[str] = frozenset()
    looks = []
    for _ in range(AGAIN + 1):
        decision = decide(stage, motion, base, least, say, without, distinct, promising if doubled else None)
        looks.append((decision.first_look, decision.first_refined))
        decision.first_look, decision.first_refined = looks[0]
        decision.refined = consistent(decision.refined)
        final = decision.refined.fitted
        if not decision.choices:
            break
        # Names that leave a clear dependence on something are the nearest names, not the right ones.
        left = locate(motion, final.residual, None, seed)
        decision.abstain_if_poor(least, any(p.share > STRUCTURED for p in left))
        if not decision.choices:
            break
        entries = [dict(e) for e in decision.refined.entries]
        first = str(entries[0]["name"])
        named, own, decision.choices = _fold(stage, final, entries, decision.choices)
        held = HeldOut.of(own, motion)
        typical = held.typically(plain)
        fit = Fit(before, plain.error, held.error, rest)
        shaped = any(str(e["name"]) not in SHAPELESS for e in entries)
        part = must_explain(decision.left(floor), doubled)
        strays = shaped and departure(final) > 1.5 * departure(base) + STRAYED
        little = shaped and explains_little(fit, part)
        if shaped and not little and leaves_much(fit, len(named), doubled):
            # What kernels of several leave of each other, their double leaves too: no sign of anything else.
            double = Double.of(stage, decision.refined, motion, floor) if len(named) > 1 else None
            little = double is None or leaves_more(final, double)
        if faint or decision.faint:
            # Where the level shows nothing, whatever else is in one block is as large as the name.
            little = typical > CONFIRMED and (little or fit.after > CONFIRMED * fit.retuned)
            # Nor is a name shown by a few chances alike, as readings are at reversals.
            little |= may_be_nothing(decision.refined)
        once = any(e["name"] == "sensor-jump" for e in named)
        if named:
            good = holds(fit, typical, once) and not (strays or little)
        else:  # what was found only changes believed numbers
            good = not does_harm(fit, 1.5 * rest)
        if good:
            return Explanation(decision, named, entries, own, final, fit)
        if little and len(entries) > 1:
            break  # others beside each other would not be nearer
        without |= {first}
    # What the ledger gains must hold in the stage itself; else it is not offered as an explanation.
    decision.choices = []
    return Explanation(decision, [], [], retuned, base, Fit(before, plain.error, plain.error, rest))


def _to_look_for(
    motion: Motion, base: Fitted, floor: Floats, least: Floats, seed: int
) -> tuple[bool, float | None]:
    """Return whether the level of the error shows nothing, and what part of it an entry must explain then."""
    # A floor is an expectation: where most of what is left hangs on one thing, it is no noise.
    small = bool(base.errors.sum() < ABOVE_FLOOR * least.sum())
    clear = small and any(p.share > CLEAR for p in locate(motion, base.residual, None, seed))
    # And where it does not, an entry may still stand out: but that must be seen where nothing was fitted.
    distinct = None
    if clear or base.errors.sum() > NEGLIGIBLE**2 * _power(base):
        distinct = DISTINCT
    elif base.errors.sum() > ABOVE_FLOOR * floor.sum():
        distinct = MAINLY
    return small and not clear, distinct


def _power(base: Fitted) -> float:
    """Return the squared force (N^2) that the motion seen needs."""
    return float(base.system.blocks.power[base.ledger.seen].sum())


EVEN = 0.01
"""Asymmetry of viscous friction below which there is none."""


def _fold(
    stage: Stage, final: Fitted, found: list[Entry], choices: list[Choice]
) -> tuple[list[Entry], Stage, list[Choice]]:
    """Put entries that only change a believed number into that number; return the others, and the stage."""
    named, kept, changes = [], [], {}
    plain = extended_stage(stage, final, [])
    for entry, choice in zip(found, choices, strict=True):
        name = str(entry["name"])
        if name == "viscous-friction" and stage.mechanics.viscous > 0:
            value = plain.mechanics.viscous + float(entry["coefficient"])  # type: ignore[arg-type]
            changes["viscous"] = max(value, 0.0)
        elif name == "asymmetric-viscous-friction" and abs(float(entry["ratio"])) < EVEN:  # type: ignore[arg-type]
            # Viscous friction is alike in both directions; only its size is another, which that released.
            changes["viscous"] = plain.mechanics.viscous
        elif name == "inertia":
            # The base's mass is refitted beside the entry, whose kernel replaces the believed one.
            changes["mass"] = float(entry["mass"]) * plain.mass / stage.mass  # type: ignore[arg-type]
        else:
            named.append(entry)
            kept.append(choice)
    own = extended_stage(stage, final, named)
    return named, own.with_changes(stage=changes) if changes else own, kept
