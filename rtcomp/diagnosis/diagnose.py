"""The whole diagnosis: refit, look for the place, name, extend, judge on what was not seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rtcomp.diagnosis.accept import ABOVE_FLOOR
from rtcomp.diagnosis.base import Fitted, finer, fit_base
from rtcomp.diagnosis.believed_effects import numbers_moved, other_numbers
from rtcomp.diagnosis.by_position.sticking import MUCH, mostly_hidden
from rtcomp.diagnosis.by_position.told import told_by_position
from rtcomp.diagnosis.certain import (
    Numbers,
    all_by_one_factor,
    birge,
    force_constant,
    intervals,
    neighbours,
    retunings,
)
from rtcomp.diagnosis.curves import curves, left_over
from rtcomp.diagnosis.decide import Choice, Decision
from rtcomp.diagnosis.experiment import next_experiment
from rtcomp.diagnosis.explain import NEGLIGIBLE, explain
from rtcomp.diagnosis.extend import extended_stage, with_forces
from rtcomp.diagnosis.floor import floor_errors
from rtcomp.diagnosis.held_out import HeldOut
from rtcomp.diagnosis.holding import AGREES, does_harm
from rtcomp.diagnosis.locate import locate
from rtcomp.diagnosis.motion import Motion, prepare
from rtcomp.diagnosis.notes import known_here, looked_at, or_else
from rtcomp.diagnosis.refine import Refined, refine
from rtcomp.diagnosis.renamed import renamed
from rtcomp.diagnosis.result import (
    Candidate,
    Diagnosis,
    Experiment,
    Fit,
    Named,
    Place,
    Sight,
    Value,
    Verdict,
)
from rtcomp.diagnosis.scene import Entry
from rtcomp.diagnosis.sight import pinned, sight
from rtcomp.errors import RtcompError
from rtcomp.kernels import Floats
from rtcomp.physics import catalogue
from rtcomp.recording.reader import Recording
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis

OPEN = 4.0
"""Squared error over the floor's, from which on something remains that no entry explains."""
LOUD = 0.03
"""Relative force error left by noise and method, from which on forces decide nothing where an axis sticks."""
KEPT, CLEARLY = 0.9, 0.7
"""Factors on the held-out error below which a retuned stage is given in place of the believed one: in
general, and where nothing is missing."""
ROUGH = (0.75, 1.0, 1.3)
"""Factors on the believed reaches with which the place of the mismatch is looked for at first."""

Progress = Callable[[float, str], None]
Located = Callable[[float, Sequence[Place]], None]
"""Told, before anything is named, what part of the force the refitted stage leaves open (rms), and where."""


def diagnose(
    stage: Stage,
    recordings: Sequence[Recording],
    *,
    progress: Progress | None = None,
    located: Located | None = None,
    seed: int = 0,
) -> Diagnosis:
    """Say where `stage` and `recordings` (of one rate) differ, what is missing, and what it explains.

    `progress` hears how far each step is, `located` the places of the mismatch before anything is named.
    """
    say: Progress = progress or (lambda _part, _what: None)
    say(0.0, "balance")
    motion = prepare(stage, recordings)
    if located is not None:
        # Few reaches are enough to say where; all of them are tried for what is.
        rough = fit_base(stage, motion, scales=ROUGH)
        part = float(np.linalg.norm(rough.residual) / max(float(np.linalg.norm(rough.system.y)), 1e-300))
        say(0.5, "balance")
        located(part, locate(motion, rough.residual, None, seed, stage.axis))
    base, floor, least = _refitted(stage, motion, seed)
    say(1.0, "balance")
    unseen_sticking = mostly_hidden(stage, recordings)
    loud = float(floor.sum()) > LOUD**2 * float(base.system.blocks.power[base.ledger.seen].sum())
    if unseen_sticking > MUCH and loud:
        return told_by_position(stage, recordings, motion, base, unseen_sticking, say, seed)
    told = explain(stage, motion, base, floor, least, say, seed)
    believed, first = stage, base
    tuned = other_numbers(stage, motion, told.final, told.entries, least)
    if tuned is not None:
        stage = tuned
        base, floor, least = _refitted(stage, motion, seed)
        told = explain(stage, motion, base, floor, least, say, seed)
        told = replace(told, fit=replace(told.fit, before=HeldOut.of(believed, motion).error))
    decision, named, final, fit = told.decision, told.named, told.final, told.fit
    if unseen_sticking > MUCH and not named and _open(final, least):
        # Forces name nothing, and in many rows friction cannot be told from the motion: they are no judge.
        by_position = told_by_position(believed, recordings, motion, base, unseen_sticking, say, seed)
        if not by_position.effects or not does_harm(by_position.fit, 1.5 * by_position.fit.floor):
            return by_position
    extended, entries_found = told.stage, told.entries
    # What is bent to an unknown cause may do far worse on other motion, however well it does on this one.
    if not named and (_open(final, least) or fit.after > KEPT * fit.before):
        extended = believed
        fit = Fit(fit.before, fit.retuned, fit.before, fit.floor)
    say(0.4, "locate")
    where = locate(motion, first.residual, final.residual if named else None, seed, stage.axis)
    refined = decision.refined if final is not base else refine(base, motion, [])
    beside = neighbours(stage, motion, refined)
    effects = _effects(decision, named, base, final, least, motion, beside)
    numbers = Numbers.of(believed, refined, beside, extended, birge(final, least))
    retuned = retunings(numbers, stage.axis)
    factor = None if named or stage.mechanics.effects else all_by_one_factor(numbers)
    if factor is not None and extended is not believed:
        extended = with_forces(extended, 1.0 / factor[0])
        retuned = [force_constant(believed, *factor)]
    if tuned is not None and extended is not believed:
        retuned += numbers_moved(believed, tuned, motion, refined, birge(final, least))
    folded = bool(entries_found) and not named and extended is not believed
    verdict = _verdict(effects, final, floor, least, fit, folded)
    if verdict == "consistent":
        where = []
        if fit.before < 1.5 * fit.floor or fit.after > CLEARLY * fit.before:
            # Numbers bent to noise predict other motion worse than the believed ones.
            extended = believed
            fit = Fit(fit.before, fit.retuned, fit.before, fit.floor)
    elif verdict == "unexplained" and not effects:
        effects = [Named(("unexplained",), 1.0, {}, 1.0)]
    if any(e.names == ("unexplained",) for e in effects):
        drawn = left_over(locate(motion, final.residual, None, seed, stage.axis))
        effects = [replace(e, curve=drawn) if e.names == ("unexplained",) else e for e in effects]
    say(0.6, "locate")
    sights = sight(motion, final, entries_found if final is not base else [], least)
    seen_here = {name for effect in effects for name in effect.names}
    retuned, flat = pinned(retuned, sights)
    say(0.8, "locate")
    experiment = None
    for choice in decision.choices:
        if named and len(choice.names) > 1:
            experiment = _tell_apart(choice, named, stage, final, motion)
            break
    say(1.0, "done")
    return Diagnosis(
        verdict,
        where,
        retuned if verdict != "consistent" else [],
        effects,
        fit,
        [s.name for s in sights if not s.seen and s.name not in seen_here],
        extended,
        experiment,
        sights,
        _candidates(decision, base, sights),
        [
            *looked_at(motion, recordings),
            *known_here(named, motion, stage.axis),
            *or_else(retuned, named),
            *flat,
        ],
        motion.plain([s.time for s in motion.strips]),
        first.residual,
        final.residual,
        np.isin(base.ledger.block, motion.unseen).astype(np.float64),
    )


def _refitted(stage: Stage, motion: Motion, seed: int) -> tuple[Fitted, Floats, Floats]:
    """Return the stage refitted, and squared errors (N^2) of seen blocks: the floor, and worth a look."""
    base = finer(stage, motion, fit_base(stage, motion))
    floor = floor_errors(extended_stage(stage, base, []), base, motion, seed + 1)
    power = base.system.blocks.power[base.ledger.seen]
    return base, floor, np.maximum(floor, NEGLIGIBLE**2 / ABOVE_FLOOR * power)


def _effects(
    decision: Decision,
    named: list[Entry],
    base: Fitted,
    final: Fitted,
    floor: Floats,
    motion: Motion,
    beside: list[Refined],
) -> list[Named]:
    if not named:
        return []
    excess = max(float(base.errors.sum() - floor.sum()), 1e-300)
    spans = intervals(decision.refined, beside, birge(final, floor))
    found: list[Named] = []
    drawn = curves(motion, final, decision.refined.entries, final.ledger.stage.axis)
    for entry, choice in zip(named, decision.choices, strict=True):
        twin = next((i for i, e in enumerate(found) if e.names == tuple(choice.names)), None)
        if twin is not None:  # a harmonic of one that is named already
            found[twin] = replace(found[twin], share=min(found[twin].share + choice.gain / excess, 1.0))
            continue
        at = next(i for i, e in enumerate(decision.refined.entries) if e["name"] == entry["name"])
        values = {}
        for parameter in catalogue.entry(str(entry["name"])).parameters:
            value = entry.get(parameter.name)
            if isinstance(value, int | float):
                low, high = spans.get((at, parameter.name), (float(value), float(value)))
                unit = for_axis(parameter.unit, base.ledger.stage.axis)
                values[parameter.name] = Value(float(value), low, high, unit)
        share = float(np.clip(choice.gain / excess, 0.0, 1.0))
        told = _experiment_of(choice)
        found.append(Named(tuple(choice.names), choice.probability, values, share, told, drawn[at]))
    found.sort(key=lambda e: -e.share)
    left = float(final.errors.sum() - floor.sum()) / excess
    if left > 0.2 and float(final.errors.sum()) > OPEN * float(floor.sum()):
        found.append(Named(("unexplained",), 1.0, {}, left))
    return found


def _experiment_of(choice: Choice) -> str:
    if len(choice.names) < 2:
        return ""
    return "; ".join(f"{n}: {catalogue.entry(n).experiment}" for n in choice.names)


def _open(final: Fitted, least: Floats) -> bool:
    """Tell whether a fit leaves more than noise, method and what beliefs may be wrong by."""
    power = float(final.system.blocks.power[final.ledger.seen].sum())
    return float(final.errors.sum()) > max(OPEN * float(least.sum()), AGREES**2 * power)


def _verdict(
    effects: list[Named], final: Fitted, floor: Floats, least: Floats, fit: Fit, folded: bool
) -> Verdict:
    """Return the verdict; `folded`: what was named only changes believed numbers, and does."""
    if effects:
        return "missing-physics"
    left = float(final.errors.sum())
    if _open(final, least):
        return "unexplained"
    if folded or (fit.before > 1.25 * fit.after and fit.before > AGREES):
        return "retuned"
    return "consistent" if left < 100 * float(floor.sum()) else "unexplained"


def _tell_apart(
    choice: Choice, named: list[Entry], stage: Stage, final: Fitted, motion: Motion
) -> Experiment | None:
    first, second = choice.names[0], choice.names[1]
    at = next(i for i, e in enumerate(named) if e["name"] == first)
    other = renamed(named[at], second, stage)
    if other is None:
        return None
    swapped = [*named[:at], other, *named[at + 1 :]]
    try:
        return next_experiment(
            extended_stage(stage, final, named),
            extended_stage(stage, final, swapped),
            (first, second),
            motion,
        )
    except RtcompError:
        return None


def _candidates(decision: Decision, base: Fitted, sights: Sequence[Sight]) -> list[Candidate]:
    found, from_size = [], {s.name: s for s in sights}
    for s in decision.first_look:
        gained = base.errors - s.errors
        scatter = float(gained.std(ddof=1) * np.sqrt(gained.size)) or 1e-300
        gain = max(s.gain(base.errors), decision.first_refined.get(s.name, -np.inf))
        at = from_size.pop(s.name, None)
        z = float(gained.sum()) / scatter
        if at is None:
            found.append(Candidate(s.name, gain, z, True))
        else:
            found.append(Candidate(s.name, gain, z, at.seen, at.smallest, parameter=at.parameter))
    found += [Candidate(s.name, 0.0, math.nan, False) for s in from_size.values() if not s.seen]
    return sorted(found, key=lambda c: -c.gain)
