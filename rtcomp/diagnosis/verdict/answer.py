"""From the chosen model to the answer: verdict, names, numbers, stage, and what was left open."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.intervals import Told, believed_sizes, numbers, told
from rtcomp.diagnosis.fitting.other_forms import any_laws, errors_beside, in_any_form
from rtcomp.diagnosis.fitting.retuned import Numbers, law, retunings
from rtcomp.diagnosis.fitting.stage_of import in_units, with_effect
from rtcomp.diagnosis.fitting.unbiased import unbiased
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.noise import Noise
from rtcomp.diagnosis.mismatch.curves import left_over
from rtcomp.diagnosis.mismatch.locate import locate
from rtcomp.diagnosis.mismatch.where import Compared, curves, left_seen
from rtcomp.diagnosis.numerics.significance import SURE
from rtcomp.diagnosis.numerics.spectrum import white_noise
from rtcomp.diagnosis.result import Candidate, Diagnosis, Experiment, Fit, Named, Retuned, Value, Verdict
from rtcomp.diagnosis.search.as_believed import agrees
from rtcomp.diagnosis.search.confidence import Alternatives
from rtcomp.diagnosis.search.selection import Search
from rtcomp.diagnosis.settings import LEAST_GAIN, LEFT, LEVEL, TOLERANCE
from rtcomp.diagnosis.verdict.detectability import sights
from rtcomp.diagnosis.verdict.experiment import next_experiment
from rtcomp.diagnosis.verdict.one_cause import LENGTH, Cause, fixed_units, force_constant, one_cause
from rtcomp.diagnosis.verdict.validation import Reserved
from rtcomp.errors import ConfigError, RtcompError
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis, prefixed

UNEXPLAINED = ("unexplained",)
LOUDER = "the readings are {:.1f} times as noisy as the stage states (sensor.noise): taken as they are"
NOT_BORNE_OUT = "not named, for a stage with it leaves more than one without it"


@dataclass(frozen=True)
class Rest:
    """What the chosen model leaves beyond noise."""

    significant: bool
    """More than its replicates leave, above the noise more than models are off, and enough to be named."""
    share: float
    """Part of the baseline's error above the noise."""

    @classmethod
    def of(cls, fitter: Fitter, found: Search) -> Rest:
        """Measure it against replicates of the chosen model, its effects by any law of what they go by."""
        forms = np.concatenate([fitter.other_friction(found.chosen), any_laws(fitter, found.chosen)])
        errors = errors_beside(fitter, found.chosen, forms)
        error, first = float(errors.sum()), float(found.baseline.errors.sum())
        noise = found.null.noise if found.null is not None else math.inf
        rest = in_any_form(fitter, found.chosen, forms)
        relative = fitter.above_noise(rest, noise=noise)
        if found.null is None:
            return cls(relative > TOLERANCE, 1.0 if not found.chosen.terms else error / first)
        share = max(error - noise, 0.0) / max(first - noise, 1e-300)
        # Of many small things none of which could be named, the square counts: they do not add up to one.
        matters = relative > TOLERANCE and (not found.chosen.terms or share > LEAST_GAIN)
        significant = (matters or found.cut_short) and found.null.p_of_error(errors) < LEVEL
        return cls(significant, min(share, 1.0))


def answer(
    believed: Stage,
    fitter: Fitter,
    found: Search,
    sets: Sequence[Alternatives],
    reserved: Reserved,
    seed: int,
    ends: float,
) -> Diagnosis:
    """Return the diagnosis that a search ends in, with what was not seen as far as the time `ends` allows."""
    balance, rest = fitter.balance, Rest.of(fitter, found)
    base = _unbiased(fitter, found, found.baseline)
    chosen = base if found.chosen is found.baseline else _unbiased(fitter, found, found.chosen)
    spans = told(fitter, chosen)
    notes = _notes(balance, found)
    shares = _shares(base, chosen, sets)
    named = _named(fitter, chosen, spans, sets, shares, rest)
    if named and _worse(_gains(fitter, *seen_by(fitter, fitter.stage(base), fitter.stage(chosen)))):
        notes.append(f"{', '.join(ent.names(chosen.entries))}: {NOT_BORNE_OUT}")
        named = []
    final = chosen if named else base
    view = Compared(balance)
    cause = None if named or rest.significant else _cause(fitter, believed, base)
    before, after = fitter.force(base), fitter.force(final)
    part = rest.share if named else _left_of_belief(fitter, found, believed, base)
    slight = not named and part <= LEFT

    def unexplained(share: float) -> Named:
        left = locate(view, after, None, seed, believed.axis)
        return Named(UNEXPLAINED, 1.0, {}, share, curve=left_over(left))

    if rest.significant or (chosen.terms and not named):
        named.append(unexplained(min(part, 1.0) if named or slight else 1.0))
    stages, moved = _stages(believed, fitter, base, final, cause)
    moved = [] if found.as_believed else moved
    if cause is not None and cause.unit == LENGTH:
        named.append(_other_scale(fitter, believed, stages["retuned"], cause))
    verdict, matters = _verdict(named, fitter, believed, stages["retuned"], moved, slight=slight)
    if verdict == "consistent" and fitter.by_force and not agrees(fitter, believed, seed):
        verdict, named = "unexplained", [unexplained(1.0)]
    if not matters:
        stages["after"] = stages["retuned"] = believed
    errors = reserved.judge({"before": believed, **stages})
    fit = Fit(errors["before"], errors["retuned"], errors["after"], errors["noise"])
    where = (
        [] if verdict == "consistent" else locate(view, before, after if named else None, seed, believed.axis)
    )
    beside = found.beside if final is chosen else None
    seen = [] if found.cut else sights(fitter, final, found.null, beside, ends)
    names = {n for e in named for n in e.names}
    return Diagnosis(
        verdict,
        where,
        moved if matters else [],
        named,
        fit,
        [s.name for s in seen if not s.seen and s.name not in names],
        stages["after"],
        _experiment(fitter, chosen, sets, named, view),
        seen,
        [Candidate(n, _part(g), _z(p), True) for n, g, p in found.screened],
        notes,
        view.plain([s.time for s in view.strips]),
        before,
        after,
        balance.reserved[balance.block].astype(np.float64),
        fitter.position(believed, stages["retuned"], stages["after"], seed),
        stages["retuned"],
    )


def _unbiased(fitter: Fitter, found: Search, model: Fitted) -> Fitted:
    """Return a model without the bias of its fit, where replicates of it tell that."""
    if found.null is None or found.null.numbers is None or model is not found.replicated:
        return model
    return unbiased(fitter, model, found.null.numbers)


def _part(gain: float) -> float:
    return max(1.0 - math.exp(-gain), 0.0)


def _z(p: float) -> float:
    from scipy.special import ndtri

    return -float(ndtri(min(max(p, 1e-300), 1.0 - 1e-12))) if math.isfinite(p) else math.nan


def _shares(base: Fitted, chosen: Fitted, sets: Sequence[Alternatives]) -> list[float]:
    """Return the part of the mismatch that each effect explains: by what its absence would leave."""
    lost = [float(chosen.errors.sum()) * (1.0 / max(1.0 - s.gain, 1e-12) - 1.0) for s in sets]
    explained = 1.0 - float(chosen.errors.sum() / base.errors.sum())
    total = sum(lost) or 1.0
    return [explained * one / total for one in lost]


def _named(
    fitter: Fitter,
    chosen: Fitted,
    spans: Sequence[Told],
    sets: Sequence[Alternatives],
    shares: Sequence[float],
    rest: Rest,
) -> list[Named]:
    without = [fitter.without(chosen, i) for i in range(len(chosen.terms))]
    drawn = curves(fitter.balance, chosen.entries, fitter.force(chosen), without)
    found = []
    for one, span, share, curve in zip(sets, spans, shares, drawn, strict=True):
        sure = one.probability * (1.0 - (rest.share if rest.significant else 0.0))
        apart = ""
        if len(one.names) > 1:
            apart = "; ".join(f"{n}: {ent.kind_of({'name': n}).experiment}" for n in one.names)
        found.append(Named(one.names, sure, span.values, float(np.clip(share, 0.0, 1.0)), apart, curve))
    return sorted(found, key=lambda e: -e.share)


def _cause(fitter: Fitter, believed: Stage, base: Fitted) -> Cause | None:
    """Return the one unit behind all numbers of the belief that moved, if they matter and it is likelier."""
    if not _matters(fitter, believed, fitter.stage(base)):
        return None
    return one_cause(numbers(fitter, believed, base, effects=True), fixed_units(believed))


def _other_scale(fitter: Fitter, believed: Stage, retuned: Stage, cause: Cause) -> Named:
    """Return the scale of the sensor that does what numbers of a retuned stage do together."""
    left, first = (float(np.mean(fitter.left_by(one)[fitter.rows] ** 2)) for one in (retuned, believed))
    entry = ent.with_other_unit(cause.unit, cause.factor)
    values = {key: Value(cause.factor, cause.low, cause.high, "1") for key in entry if key != "name"}
    return Named(
        (str(entry["name"]),), cause.probability, values, float(np.clip(1.0 - left / first, 0.0, 1.0))
    )


def _stages(
    believed: Stage, fitter: Fitter, base: Fitted, final: Fitted, cause: Cause | None
) -> tuple[dict[str, Stage], list[Retuned]]:
    """Return the retuned and the extended stage, and the numbers of the belief that moved.

    In the units of the `cause`, if all moved by one.
    """
    stages = {"retuned": fitter.stage(base), "after": fitter.stage(final)}
    tuned, moved = numbers(fitter, believed, final), believed_sizes(fitter, final)
    if cause is not None:
        tuned, moved = tuned.in_units(cause.unit, cause.factor), []
        changed = {name: in_units(stage, cause.unit, cause.factor) for name, stage in stages.items()}
        if cause.unit == LENGTH:
            entry = ent.with_other_unit(cause.unit, cause.factor)
            stages["after"] = with_effect(changed["after"], entry)
        else:
            stages, moved = changed, [force_constant(believed, cause)]
    moved = [*retunings(tuned, believed.axis), *moved]
    moved += [*_found(fitter.balance, believed, tuned), *law(believed, stages["after"])]
    return stages, moved


def _found(balance: ForceBalance, believed: Stage, tuned: Numbers) -> list[Retuned]:
    """Return the friction that a belief without any lacks, where there is any to speak of."""
    drive = balance.drive_force()
    level = float(tuned.values[3])
    if believed.friction is not None or level < TOLERANCE * float(np.sqrt(np.mean(drive**2))):
        return []
    keys = (("viscous", "N s/m", 1), ("friction.level", "N", 3), ("friction.reach", "m", 4))
    found = []
    for key, unit, i in keys:
        value, half = float(tuned.values[i]), float(tuned.half[i])
        if tuned.before[i] == 0.0 and value > half:
            told = Value(value, max(value - half, 0.0), value + half, for_axis(unit, believed.axis))
            found.append(Retuned(key, 0.0, told))
    return found


def _left_of_belief(fitter: Fitter, found: Search, believed: Stage, base: Fitted) -> float:
    """Return what a refitted belief leaves of what the belief as it is leaves, squared, above the noise."""
    left, first = (
        float(np.mean(fitter.left_by(s)[fitter.rows] ** 2)) for s in (fitter.stage(base), believed)
    )
    noise = min(found.null.noise / float(base.errors.sum()), 1.0) * left if found.null is not None else 0.0
    return (left - noise) / max(first - noise, 1e-300)


def _matters(fitter: Fitter, believed: Stage, retuned: Stage) -> bool:
    """Tell whether other numbers of the belief bring down an error that is not small already."""
    before, after = (fitter.left_by(stage) for stage in (believed, retuned))
    relative = float(np.sqrt(np.mean(before[fitter.rows] ** 2)))
    least = -2.0 * math.log1p(-LEAST_GAIN)
    return relative > TOLERANCE and float(_gains(fitter, before, after).mean()) > least


def _gains(fitter: Fitter, before: Floats, after: Floats) -> Floats:
    """Return the gain in each block that was fitted, (B_use,), of what is left after on that before, (n,)."""
    sums = [np.bincount(fitter.block, left**2, fitter.blocks)[fitter.use] for left in (before, after)]
    return np.asarray(np.diff(-np.log(np.maximum(sums, 1e-300)), axis=0)[0])


def seen_by(fitter: Fitter, *stages: Stage) -> list[Floats]:
    """Return what stages leave in each row, (n,), of forces above the noise, which goes by the mass."""
    return left_seen(fitter.balance, *stages) if fitter.by_force else list(map(fitter.left_by, stages))


def _worse(gains: Floats) -> bool:
    """Tell whether gains (B,) are plainly losses."""
    return bool(gains.mean() + SURE * gains.std() / math.sqrt(gains.size) < 0.0)


def _verdict(
    named: Sequence[Named],
    fitter: Fitter,
    believed: Stage,
    retuned: Stage,
    moved: Sequence[Retuned],
    *,
    slight: bool,
) -> tuple[Verdict, bool]:
    """Return the verdict, and whether other numbers than the believed ones are given."""
    if any(e.names != UNEXPLAINED for e in named):
        return "missing-physics", True
    matters = bool(moved) and _matters(fitter, believed, retuned)
    if named:
        # Numbers bent to an unknown cause may do worse on other motion; friction where none was, not, nor
        # numbers that leave only a slight part to it.
        return "unexplained", matters and (slight or believed.friction is None)
    return ("retuned", True) if matters else ("consistent", False)


def _notes(balance: ForceBalance, found: Search) -> list[str]:
    notes = [f"frequencies count by signal to noise, up to {balance.noise.bandwidth:.3g} Hz", *found.dropped]
    white = min(white_noise([s.position for s in balance.data.segments]), balance.noise.rms)
    louder = white / (Noise.stated(balance.stage) or math.inf)
    notes += [LOUDER.format(louder)] if round(louder, 1) > 1.0 else []
    names = ent.names(found.chosen.entries)
    (low, high), unit = prefixed(for_axis("m", balance.stage.axis), *balance.data.stroke)
    if names:
        notes.append(f"known from {low} to {high} {unit}, where this motion went, and not beyond")
    return notes


def _experiment(
    fitter: Fitter,
    chosen: Fitted,
    sets: Sequence[Alternatives],
    named: Sequence[Named],
    view: Compared,
) -> Experiment | None:
    """Return the motion that tells apart what this one does not, None where there is nothing to."""
    for one in sets:
        if len(one.names) < 2 or not any(e.names == one.names for e in named):
            continue
        try:
            stages = [fitter.stage(m) for m in one.models[:2]]
            return next_experiment(stages[0], stages[1], (one.names[0], one.names[1]), view)
        except (ConfigError, RtcompError):
            return None
    return None
