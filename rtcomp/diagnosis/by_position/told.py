"""The whole diagnosis where the balance of forces decides nothing: decided by simulated position."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from rtcomp.diagnosis.base import Fitted
from rtcomp.diagnosis.by_position.decide import Judge, Verdicts, decide, drop, scale_of
from rtcomp.diagnosis.by_position.sticking import count_of, hidden
from rtcomp.diagnosis.by_position.turning import Knob, Setting, fit, robust
from rtcomp.diagnosis.by_position.windows import Windows, windows_of
from rtcomp.diagnosis.holding import HARM, HELP
from rtcomp.diagnosis.locate import locate
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.result import Candidate, Diagnosis, Fit, Named, PositionFit, Retuned, Value, Verdict
from rtcomp.diagnosis.scene import Scene
from rtcomp.kernels import Floats
from rtcomp.physics import catalogue
from rtcomp.recording.reader import Recording
from rtcomp.stage.balance import force_balance
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis

MOVED = 0.02
"""Relative change of a parameter that is worth reporting."""
MODEL = 0.005
"""Relative half width of an interval that no amount of data removes."""
LEFT = 0.2
"""Part of the error above the floor that names may leave without it being said."""
SMALL = 1.5
"""Times the noise's error of windows not seen, below which names need not help."""
LONGEST = 0.5
"""Longest period of a wave along the stroke, in strokes: what was not seen twice is not known to recur."""
UNITS = {
    "mass": "kg",
    "force_constant": "N/V",
    "viscous": "N s/m",
    "friction.level": "N",
    "friction.reach": "m",
}
UNSEEABLE = ("sensor-scale",)

Progress = Callable[[float, str], None]


def told_by_position(
    stage: Stage,
    recordings: Sequence[Recording],
    motion: Motion,
    base: Fitted,
    hidden_part: float,
    say: Progress,
    seed: int = 0,
) -> Diagnosis:
    """Say where `stage` and `recordings` differ, judged by the position that short simulations end at."""
    windows = windows_of(recordings, motion.cut)
    low, high = motion.stroke
    believed = Setting(stage, {}, (), LONGEST * (high - low))
    decided = decide(Scene.of(motion, base), believed, windows, say, seed)
    halves = _halves(decided, believed, windows)
    while (at := unsure(decided, halves)) is not None:
        drop(Judge(windows, scale_of(believed, windows)), decided, at)
        halves = _halves(decided, believed, windows)
    say(0.2, "judge")
    extended, retuned_stage = decided.best.setting.stage(), decided.base.setting.stage()
    errors = _position(stage, retuned_stage, extended, windows, motion.cut, seed)
    if decided.steps and not holds(errors):
        # What is gained on the windows seen must hold on the others; else it is no explanation.
        decided.best, decided.steps = decided.base, []
        halves = _halves(decided, believed, windows)
        extended = retuned_stage
        errors = _position(stage, retuned_stage, extended, windows, motion.cut, seed)
    if not decided.steps and errors.before <= errors.after:
        extended = stage
        errors = _position(stage, retuned_stage, extended, windows, motion.cut, seed)
    say(0.6, "judge")
    effects = _effects(decided, halves)
    verdict = _verdict(decided, effects, errors)
    if verdict == "unexplained":
        effects = [*effects, Named(("unexplained",), 1.0, {}, 1.0)]
    before, after = (_residual(s, stage, motion) for s in (retuned_stage, extended))
    say(0.2, "locate")
    where = locate(motion, before, after if decided.steps else None, seed, stage.axis)
    stages = (stage, retuned_stage, extended)
    force = [_force_error(s, stage, windows, motion.cut) for s in stages]
    say(1.0, "done")
    note = (
        f"the axis sticks finer than a count of its sensor in {100 * hidden_part:.0f} % of the rows, where "
        f"motion tells nothing of friction: judged by position, simulated over {windows.seconds:.2g} s from "
        "points of the recording"
    )
    tried = set(decided.gains)
    return Diagnosis(
        verdict,
        where if verdict != "consistent" else [],
        _retuned(stage, decided, halves) if verdict != "consistent" else [],
        effects,
        Fit(force[0], force[1], force[2], _force_floor(stage, motion)),
        list(UNSEEABLE),
        extended,
        candidates=[
            *(
                Candidate(n, g, z, True)
                for n, (g, z) in sorted(decided.gains.items(), key=lambda p: -p[1][0])
            ),
            *(Candidate(n, 0.0, 0.0, False) for n in UNSEEABLE if n not in tried),
        ],
        notes=[note, f"forces are compared below {motion.cut:.3g} Hz, on rows that do not stick so"],
        time=motion.plain([s.time for s in motion.strips]),
        residual_before=before,
        residual_after=after,
        unseen=np.zeros(before.size),
        position=errors,
        retuned_stage=retuned_stage,
    )


def unsure(decided: Verdicts, halves: dict[tuple[int, str], float]) -> int | None:
    """Return which entry's size is not told from none, the last found first; None where all are.

    Over short windows such a one may end closer by chance; in closed loop it need not be small.
    """
    knobs = {(k.entry, k.name): k for k in decided.best.setting.knobs()}
    for at, entry in reversed(list(enumerate(decided.best.setting.entries))):
        sizes = catalogue.entry(str(entry["name"])).neutral or {}
        spans = []
        for name, nothing in sizes.items():
            if isinstance(entry.get(name), int | float) and (at, name) in knobs:
                low, high = _interval(float(entry[name]), knobs[at, name], halves.get((at, name), 0.0))  # type: ignore[arg-type]
                spans.append(low <= nothing <= high)
        if spans and all(spans):
            return at
    return None


def _position(
    stage: Stage, retuned: Stage, extended: Stage, windows: Windows, cut: float, seed: int
) -> PositionFit:
    unseen = ~windows.seen if not windows.seen.all() else windows.seen
    clean = windows.as_if(extended, cut, seed)
    off = [float(np.mean(np.abs(windows.off(s, unseen)))) for s in (stage, retuned, extended)]
    floor = float(np.mean(np.abs(clean.off(extended, unseen))))
    return PositionFit(off[0], off[1], off[2], floor, windows.seconds)


def holds(errors: PositionFit) -> bool:
    """Tell whether names end closer on windows that were not seen, by more than chance would."""
    helps = errors.after < max(HELP * errors.retuned, SMALL * errors.floor)
    return helps and errors.after <= HARM * min(errors.before, errors.retuned)


def _verdict(decided: Verdicts, effects: Sequence[Named], errors: PositionFit) -> Verdict:
    if decided.steps:
        return "missing-physics"
    base = float(decided.base.outside.sum())
    if base - decided.floor > 2.0 * decided.floor and errors.after > 2.0 * errors.floor:
        return "unexplained"
    return "retuned" if errors.before > 1.25 * errors.after else "consistent"


def _effects(decided: Verdicts, halves: dict[tuple[int, str], float]) -> list[Named]:
    if not decided.steps:
        return []
    base = max(float(decided.base.outside.sum()) - decided.floor, 1e-300)
    knobs = {(k.entry, k.name): k for k in decided.best.setting.knobs()}
    axis = decided.best.setting.believed.axis
    found = []
    for i, (entry, step) in enumerate(zip(decided.best.setting.entries, decided.steps, strict=True)):
        values = {}
        for p in catalogue.entry(str(entry["name"])).parameters:
            value = entry.get(p.name)
            if isinstance(value, int | float):
                knob = knobs.get((i, p.name))
                low, high = _interval(float(value), knob, halves.get((i, p.name), 0.0))
                values[p.name] = Value(float(value), low, high, for_axis(p.unit, axis))
        apart = "; ".join(f"{n}: {catalogue.entry(n).experiment}" for n in step.names)
        share = float(np.clip(step.gain / base, 0.0, 1.0))
        found.append(
            Named(tuple(step.names), step.probability, values, share, apart if step.names[1:] else "")
        )
    found.sort(key=lambda e: -e.share)
    left = (float(decided.best.outside.sum()) - decided.floor) / base
    if left > LEFT:
        found.append(Named(("unexplained",), 1.0, {}, left))
    return found


def _interval(value: float, knob: Knob | None, half: float) -> tuple[float, float]:
    if knob is None:
        return value, value
    if knob.kind == "add":
        half = float(np.hypot(half * knob.size, MODEL * abs(value)))
        return value - half, value + half
    half = float(np.hypot(half, MODEL))
    return value * float(np.exp(-half)), value * float(np.exp(half))


def _retuned(stage: Stage, decided: Verdicts, halves: dict[tuple[int, str], float]) -> list[Retuned]:
    m, best = stage.mechanics, decided.best.setting
    believed = {"mass": stage.mass, "force_constant": stage.force_constant, "viscous": m.viscous}
    if isinstance(m.friction, list):
        believed["friction.level"] = sum(e.stiffness * e.reach for e in m.friction)
    for effect in m.effects:
        for p in catalogue.entry(str(effect["name"])).parameters:
            if isinstance(effect.get(p.name), int | float):
                believed[f"{effect['name']}.{p.name}"] = float(effect[p.name])
    found = []
    for knob in best.knobs():
        factor = best.factors.get(knob.name, 1.0)
        old = believed.get(knob.name)
        if knob.entry >= 0 or knob.kind == "add" or old is None or abs(factor - 1.0) < MOVED:
            continue  # a reach finer than the sensor's count is not known, whatever the fit made of it
        low, high = _interval(old * factor, knob, halves.get((-1, knob.name), 0.0))
        if not low <= old <= high:
            unit = for_axis(_unit(knob.name), stage.axis)
            found.append(Retuned(knob.name, old, Value(old * factor, low, high, unit)))
    return found


def _unit(name: str) -> str:
    if name in UNITS:
        return UNITS[name]
    effect, _, parameter = name.partition(".")
    return next(p.unit for p in catalogue.entry(effect).parameters if p.name == parameter)


def _halves(decided: Verdicts, believed: Setting, windows: Windows) -> dict[tuple[int, str], float]:
    """Return half widths of 95 % intervals in turns, by the scatter of the blocks (a sandwich)."""
    from scipy.stats import t as student

    scale = scale_of(believed, windows)
    judge = Judge(windows, scale)
    setting, jacobian, knobs = fit(decided.best.setting, windows, scale, windows.seen, 1)
    off = windows.off(setting.stage(), windows.seen)
    residual = (np.sign(off) * np.sqrt(robust(off, scale))).ravel()
    block = np.repeat(windows.block[windows.seen], windows.rows)
    inverse = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-10)
    scores = np.array([jacobian[block == b].T @ residual[block == b] for b in judge.blocks])
    count = judge.blocks.size
    meat = scores.T @ scores * count / max(count - 1, 1)
    spread = np.sqrt(np.maximum(np.diag(inverse @ meat @ inverse), 0.0))
    factor = float(student.ppf(0.975, max(count - 1, 1)))
    return {(k.entry, k.name): min(factor * float(s), 3.0) for k, s in zip(knobs, spread, strict=True)}


def _moving(stage: Stage, reading: Floats, voltage: Floats, around: int) -> np.ndarray:
    """Return the rows that are not hidden, nor within `around` rows of such."""
    stuck = hidden(stage, reading, voltage, count_of(stage)).astype(np.float64)
    return np.asarray(np.convolve(stuck, np.ones(2 * around + 1), mode="same") < 0.5)


def _force_error(stage: Stage, believed: Stage, windows: Windows, cut: float) -> float:
    """Return the relative force error of `stage` on rows that nothing was fitted to or chosen by.

    Rows hidden by the friction that is `believed` are left out.
    """
    off = over = 0.0
    for track, unseen in zip(windows.tracks, windows.unseen_rows(), strict=True):
        balance = force_balance(stage, track.time, track.position, track.voltage, cut)
        around = int(0.5 / cut / float(track.time[1] - track.time[0]))
        use = unseen & _moving(believed, track.reading, track.voltage, around)
        off += float(np.sum((balance.force_drive - balance.force_motion)[use] ** 2))
        over += float(np.sum(balance.force_motion[use] ** 2))
    return float(np.sqrt(off / over)) if over > 0 else 0.0


def _force_floor(stage: Stage, motion: Motion) -> float:
    """Return the relative force error that the sensor's counts and noise alone make of the acceleration."""
    noise = float(np.hypot(stage.sensor.noise, stage.sensor.resolution / np.sqrt(12.0)))
    force = stage.force_constant * float(np.std(np.concatenate([s.voltage for s in motion.strips])))
    band = np.sqrt(motion.cut / (2.5 * motion.rate))
    return float(stage.mass * (2 * np.pi * motion.cut) ** 2 * noise * band / max(force, 1e-300))


def _residual(stage: Stage, believed: Stage, motion: Motion) -> Floats:
    """Return the force (N, kept rows) that `stage` leaves open, nothing where the axis sticks unseen."""
    rows = []
    around = int(0.5 * motion.rate / motion.cut)
    for strip in motion.strips:
        balance = force_balance(stage, strip.time, strip.position, strip.voltage, motion.cut)
        moving = _moving(believed, strip.position, strip.voltage, around)
        rows.append(np.where(moving, balance.force_drive - balance.force_motion, 0.0))
    return motion.plain(rows)
