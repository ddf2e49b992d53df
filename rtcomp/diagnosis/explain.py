"""An explanation: names decided on, put into the stage, and held against what was put aside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.accept import ABOVE_FLOOR, DISTINCT, MAINLY
from rtcomp.diagnosis.addition import Progress
from rtcomp.diagnosis.alike import SHAPELESS
from rtcomp.diagnosis.base import Fitted
from rtcomp.diagnosis.decide import Choice, Decision, decide
from rtcomp.diagnosis.departure import departure
from rtcomp.diagnosis.extend import extended_stage
from rtcomp.diagnosis.held_out import HeldOut
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
HARM, WORSE, HELP = 1.02, 1.1, 0.95
"""Factors on the held-out error of the stage, believed, retuned and (where it is more than the floor) retuned
again, beyond which names are taken back."""
LEAST, MOST_OF_IT, MUCH, OPEN = 0.35, 0.6, 0.7, 0.2
"""Part of the held-out squared error above the floor that names with a shape of their own must explain: in
general, where the floor is a double's, and where they leave more than the part OPEN of the mismatch that was
seen."""
PROMISING = 0.45
"""The same part, of several names before they are looked for again beside each other: that mends some, but
not so much. Only where the floor is a double's."""
CONFIRMED = 0.92
"""Factor to which a name must bring the held-out error, in all or in the typical block, where the level of
the error shows nothing."""
AGREES = 0.006
"""Relative force error up to which a recording is held to agree, whatever its noise promises."""
FAR, NEARLY_ALL, TOGETHER = 4.0, 0.97, 0.9
"""Names that leave more than FAR times the floor of what was put aside, and explain less of its squared error
above that than NEARLY_ALL (a lone one) or TOGETHER, are the nearest of the catalogue to something that is not
in it. Several are held to that only where the floor is a double's: what the method leaves at the least is no
measure of how far four names may be from a machine."""
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
    power = float(base.system.blocks.power[base.ledger.seen].sum())
    rest = float(np.sqrt(floor.sum() / power))
    # A floor is an expectation: where most of what is left hangs on one thing, it is no noise.
    small = bool(base.errors.sum() < ABOVE_FLOOR * least.sum())
    clear = small and any(p.share > CLEAR for p in locate(motion, base.residual, None, seed))
    # And where it does not, an entry may still stand out: but that must be seen where nothing was fitted.
    faint = small and not clear
    distinct = DISTINCT if clear or bool(base.errors.sum() > NEGLIGIBLE**2 * power) else None
    if distinct is None and base.errors.sum() > ABOVE_FLOOR * floor.sum():
        distinct = MAINLY
    doubled = stage.controller is not None and all(s.reference is not None for s in motion.strips)

    def promising(refined: Refined) -> bool:
        together = consistent(refined)
        own = extended_stage(stage, together.fitted, together.entries)
        return not _explains_little(Fit(before, plain.error, HeldOut.of(own, motion).error, rest), PROMISING)

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
        least_part = MUCH if decision.left(floor) > OPEN else MOST_OF_IT if doubled else LEAST
        strays = shaped and departure(final) > 1.5 * departure(base) + STRAYED
        little = shaped and (_explains_little(fit, least_part) or _leaves_much(fit, len(named), doubled))
        if faint or decision.faint:
            # Where the level shows nothing, whatever else is in one block is as large as the name.
            little = typical > CONFIRMED and (little or fit.after > CONFIRMED * fit.retuned)
        once = any(e["name"] == "sensor-jump" for e in named)
        if not named or (_holds(fit, typical, once) and not strays and not little):
            return Explanation(decision, named, entries, own, final, fit)
        if little and len(entries) > 1:
            break  # others beside each other would not be nearer
        without |= {first}
    # What the ledger gains must hold in the stage itself; else it is not offered as an explanation.
    decision.choices = []
    return Explanation(decision, [], [], retuned, base, Fit(before, plain.error, plain.error, rest))


def does_harm(fit: Fit, much: float = 0.0) -> bool:
    """Tell whether what was put aside is predicted worse with names than without, and leaves over `much`."""
    return fit.after > max(HARM * fit.before, much) or fit.after > max(WORSE * fit.retuned, much)


def _holds(fit: Fit, typical: float = 1.0, once: bool = False) -> bool:
    """Tell whether names hold on what was put aside: they do no harm there, and help where there is need.

    There, or in the `typical` block of it (error over that of the retuned stage). What happens `once`
    happens in no block that is put aside; there it can only harm, and may by a little.
    """
    much = max(1.5 * fit.floor, AGREES if once else 0.0)
    if does_harm(fit, much):
        return False
    return fit.retuned < much or fit.after < HELP * fit.retuned or typical < HELP


def _explains_little(fit: Fit, least: float) -> bool:
    """Tell whether names explain so little of what was put aside that they are the nearest, not the right."""
    floor = (1.5 * fit.floor) ** 2
    return fit.retuned**2 > floor and fit.after**2 - floor > (1.0 - least) * (fit.retuned**2 - floor)


def _leaves_much(fit: Fit, names: int = 1, doubled: bool = True) -> bool:
    """Tell whether far more than noise is left of what was put aside, and more than trimming explains."""
    least = NEARLY_ALL if names == 1 else TOGETHER
    return (names == 1 or doubled) and fit.after > FAR * fit.floor and _explains_little(fit, least)


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
