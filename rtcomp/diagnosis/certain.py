"""How certain the numbers of a fit are: by scatter over blocks, by the grid of reaches, by how models model.

A residual that is alike for long does not count as many samples: whole blocks of the recording are left out
in turn, and neighbouring blocks are taken to be alike. What the grid of reaches decides is seen on grids
beside it that fit nearly as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.base import BELIEVED, ENTRY_OF, FIXED, NUMBERS, Fitted, fit_base
from rtcomp.diagnosis.blocks import Blocks
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.departure import USUAL, believed_friction
from rtcomp.diagnosis.extend import level_and_reach
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.refine import Knob, Refined, refine
from rtcomp.diagnosis.result import Retuned, Value
from rtcomp.diagnosis.scene import Scene
from rtcomp.diagnosis.typical import typical
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis

MODEL = 0.015
"""Relative half width of an interval that no data removes: kernels are models, rows are discrete. As much as
trials' plants of other physics were missed by where all else was certain."""
BESIDE = (0.85, 1.18)
"""Factors on the reaches of the grids that a fit is held against."""
MOVED = 0.02
"""Relative change of a parameter that is worth reporting."""
AT_BOUND = 0.002
"""Relative distance from the furthest that may be believed, within which the belief holds a number there."""
SEVERAL = 3
"""Numbers that must have moved for it to be said that all did."""
SECOND = (("parallel-spring", "cubic"), ("position-dependent-friction", "slope"))
"""Entries, and numbers by which they act beside their size."""
ONCE = 0.5
"""Part of all that tells a number; leaving out a block that has more of it tells nothing."""
FREEDOM, WIDE = 9, 2.262
"""Degrees of freedom of about ten blocks, and standard deviations of a 95 % interval from them (Student)."""


def neighbours(stage: Stage, motion: Motion, refined: Refined) -> list[Refined]:
    """Return the same entries refined on the grids of reaches beside the one that fits best."""
    effects = [effect_of(e) for e in refined.entries]
    fitted = refined.fitted

    def beside(factor: float) -> Refined:
        base = fit_base(stage, motion, effects, (fitted.scale * factor,), fitted.ledger.memory, fitted.freed)
        return refine(base, motion, refined.entries, tries=3)

    return shared(beside, BESIDE)


def birge(final: Fitted, floor: Floats) -> float:
    """Return the factor on every interval by which a fit is worse than noise, at least 1.

    Where something is left that no noise leaves, the model is not quite the physics, and its numbers are as
    far off as that; Birge (1932), Physical Review 40.
    """
    return max(1.0, float(np.sqrt(final.errors.sum() / max(float(floor.sum()), 1e-300))))


def _weight(best: Fitted, other: Fitted) -> float:
    """Return how much a fit beside counts: less, the worse it is."""
    return min(float(best.errors.sum()) / max(float(other.errors.sum()), 1e-300), 1.0)


def covariance(refined: Refined) -> Floats:
    """Return the covariance (q, q) of the knobs, in squares of their steps.

    Each block of the recording is left out in turn, the numbers of the base fitted anew beside the knobs
    (delete-a-group jackknife: Bell and McCaffrey 2002, Survey Methodology 28(2)). Residuals that a fit has
    bent to itself would promise too much: a score of columns takes a good part of twenty blocks up. What a
    single block tells is compared with the rest of the recording (`elsewhere`).
    """
    fitted, j = refined.fitted, refined.jacobian
    ledger = fitted.ledger
    rows = ledger.seen[ledger.block]
    free = fitted.bounds.within(fitted.coefficients)
    # What is one number together is told by the knob: beside it the base's part of it says nothing.
    named = {str(e["name"]) for e in refined.entries}
    free[:FIXED] &= [ENTRY_OF.get(number) not in named for number in NUMBERS]
    block = np.unique(ledger.block[rows], return_inverse=True)[1]
    count = int(block[-1]) + 1
    table = np.column_stack([j, fitted.system.columns[rows][:, free]])
    blocks = Blocks.of(table, -refined.residual, block, count)
    every = np.ones(count, dtype=np.bool_)
    without = []
    for k in range(count):
        others = every.copy()
        others[k] = False
        without.append(blocks.coefficients(others)[: j.shape[1]])
    spread = scatter(np.array(without))
    for k in range(j.shape[1]):
        own = blocks.own_part(table, k)
        told = np.bincount(block, own**2, count)
        if told.max() > ONCE * told.sum():
            spread[k] = spread[:, k] = 0.0
            spread[k, k] = elsewhere(own, refined.residual)
    # What is believed of the base's numbers is as good as a measurement of them.
    return _inverse(_inverse(spread) + refined.away.T @ refined.away)


def elsewhere(column: Floats, residual: Floats) -> float:
    """Return the mean square of the coefficients that `column` (n,) finds along the whole `residual` (n,).

    The variance of the number of what happened once: as large as what a residual that is alike for long makes
    of it where it did not happen.
    """
    found = np.fft.ifft(np.fft.fft(residual) * np.conj(np.fft.fft(column))).real
    return float(np.mean(found**2)) / float(column @ column) ** 2


def _inverse(matrix: Floats) -> Floats:
    """Return the inverse of a covariance or information (q, q) whose sizes may differ by any factor.

    What is 0 stays 0: a knob that changes nothing is told nothing of.
    """
    size = np.sqrt(np.diag(matrix))
    scale = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.pinv(matrix / np.outer(scale, scale), rcond=1e-10) / np.outer(scale, scale))


def scatter(without: Floats) -> Floats:
    """Return the jackknife's covariance (q, q) of numbers found without each block in turn, (blocks, q).

    Neighbouring blocks are taken to be alike (Newey and West 1987, Econometrica 55(3), with one lag).
    """
    count = without.shape[0]
    apart = without - without.mean(axis=0)
    mixed = apart[1:].T @ apart[:-1]
    return np.asarray((apart.T @ apart + 0.5 * (mixed + mixed.T)) * (count - 1) / count)


def intervals(
    refined: Refined, beside: Sequence[Refined], worse: float = 1.0
) -> dict[tuple[int, str], tuple[float, float]]:
    """Return the 95 % interval of each parameter, by entry number and name, widened by `worse` (`birge`)."""
    from scipy.stats import t as student

    ledger = refined.fitted.ledger
    row = ledger.motion.period
    times = [(i, float(e["time"])) for i, e in enumerate(refined.entries) if "time" in e]  # type: ignore[arg-type]
    found = {(i, "time"): (t - row, t + row) for i, t in times}
    if not refined.knobs:
        return found
    spread = covariance(refined)
    factor = float(student.ppf(0.975, max(int(ledger.seen.sum()) - 1, 1)))
    for k, knob in enumerate(refined.knobs):
        if knob.item is not None:
            continue  # told with the entry, without an interval of its own
        value = knob.of(refined.entries)
        sd = float(np.sqrt(max(spread[k, k], 0.0)))
        grid = max(
            (_weight(refined.fitted, b.fitted) * _apart(knob, knob.of(b.entries), value) for b in beside),
            default=0.0,
        )
        size = 2.0 if knob.parameter.name == "phase" else abs(value)
        half = worse * float(np.sqrt((factor * sd * knob.step) ** 2 + grid**2 + (MODEL * size) ** 2))
        low, high = knob.parameter.low, knob.parameter.high  # what it may be at all
        found[knob.entry, knob.parameter.name] = (max(value - half, low), min(value + half, high))
    return found


def may_be_nothing(refined: Refined) -> bool:
    """Tell whether the 95 % interval of the last entry's size holds what would change nothing.

    An entry that acts by a second number too has that interval to pass as well.
    """
    scene, at = Scene.of(refined.fitted.ledger.motion, refined.fitted), len(refined.entries) - 1
    like = next((one for one in typical(scene, 0.0) if one.name == refined.entries[at]["name"]), None)
    if like is None:
        return False
    spans = intervals(refined, [])
    neutral = [(like.size, like.neutral)]
    neutral += [(number, 0.0) for name, number in SECOND if name == like.name]
    held = [spans[at, size][0] <= none <= spans[at, size][1] for size, none in neutral if (at, size) in spans]
    return bool(held) and all(held)


def _apart(knob: Knob, one: float, other: float) -> float:
    if knob.parameter.name == "phase":
        return float(abs((one - other + np.pi) % (2 * np.pi) - np.pi))
    return abs(one - other)


@dataclass(frozen=True)
class Numbers:
    """Mass, viscous friction, micro-damping, level and reach of friction, believed and found, (5,) each.

    Sizes of forces of believed effects may follow.
    """

    before: Floats
    values: Floats
    half: Floats
    """Half widths of plain 95 % intervals."""
    held: Floats
    """How far back the interval reaches of what the belief holds at its bound, 0 of the others."""

    @classmethod
    def of(
        cls, believed: Stage, refined: Refined, beside: Sequence[Refined], extended: Stage, worse: float = 1.0
    ) -> Numbers:
        """Gather them; `worse` widens the intervals (`birge`)."""
        final = refined.fitted
        seen = final.ledger.seen
        sets = []
        for k in np.flatnonzero(seen):
            others = seen.copy()
            others[k] = False
            sets.append(_numbers(final, final.system.blocks.coefficients(others, final.bounds)))
        values = _numbers(final, final.coefficients)
        spread = np.diag(scatter(np.array(sets)))
        grid = np.zeros(values.size)
        for b in beside:
            apart = np.abs(_numbers(b.fitted, b.fitted.coefficients) - values)
            grid = np.maximum(grid, _weight(final, b.fitted) * apart)
        m, now = believed.mechanics, extended.mechanics
        values[:2] = now.mass, now.viscous  # with what was folded into them
        if refined.knobs:
            # What the entries' own numbers leave open, these do, as far as they make up for them.
            pulled = _pulled(believed, refined, values)
            spread = spread + np.einsum("ik,kl,il->i", pulled, covariance(refined), pulled)
        before = np.array([m.mass, m.viscous, m.micro_damping, *believed_friction(believed)])
        half = worse * np.sqrt(WIDE**2 * np.maximum(spread, 0.0) + grid**2 + (MODEL * values) ** 2)
        # What is held at its bound is so by the belief, not by the recording: its interval reaches back.
        held = np.zeros(values.size)
        for i in range(FIXED):
            if before[i] > 0 and abs(abs(values[i] / before[i] - 1.0) / BELIEVED - 1.0) < AT_BOUND:
                held[i] = BELIEVED * before[i]
        return cls(before, values, half, held)


def retunings(numbers: Numbers, axis: str) -> list[Retuned]:
    """Return the believed parameters that the fit moved, with their 95 % intervals.

    Numbers are told because they moved: of so chosen ones, plain intervals miss more than a twentieth.
    Theirs are wider by how few were chosen (Benjamini and Yekutieli 2005, J. American Statistical
    Association 100(469)).
    """
    before, values, half, held = numbers.before, numbers.values, numbers.half, numbers.held
    names = ("mass", "viscous", "micro_damping", "friction.level", "friction.reach")
    units = ("kg", "N s/m", "N s/m", "N", "m")
    moved = np.abs(values - before)
    tell = (before > 0) & (moved > MOVED * before) & (moved > held * (1.0 - 1e-6))
    clear = np.where(tell, moved / np.maximum(half, 1e-300), 0.0)
    wider = widening(clear, int(np.count_nonzero(before > 0)))
    found = []
    for i in np.flatnonzero(clear > wider).tolist():
        new, size = float(values[i]), float(max(wider * half[i], held[i]))
        value = Value(new, max(new - size, 0.0), new + size, for_axis(units[i], axis))
        found.append(Retuned(names[i], float(before[i]), value))
    return found


def all_by_one_factor(numbers: Numbers) -> tuple[float, float] | None:
    """Return the factor by which all forces moved, and the half width of its interval, if they agree.

    No recording of voltage and position tells such numbers from another force constant, which is one number
    and not four.
    """
    forces = np.flatnonzero(np.arange(numbers.before.size) != 4)  # a reach is no force
    some = numbers.before[forces] > 0
    before = numbers.before[forces][some]
    ratio, half = numbers.values[forces][some] / before, numbers.half[forces][some] / before
    open_by = np.maximum(np.maximum(half, numbers.held[forces][some] / before), 1e-9)
    factor = float(np.average(ratio, weights=open_by**-2.0))
    size = float(np.sqrt(1.0 / np.sum(open_by**-2.0)))
    clear = np.count_nonzero(np.abs(ratio - 1.0) > half)
    apart = np.abs(ratio - factor) > open_by
    if clear < SEVERAL or apart.any() or abs(factor - 1.0) < max(MOVED, size):
        return None
    return factor, size


def force_constant(believed: Stage, factor: float, half: float) -> Retuned:
    """Return another force constant in the place of forces that all moved by `factor` (+- `half`)."""
    was = believed.force_constant
    value = Value(was / factor, was / (factor + half), was / (factor - half), for_axis("N/V", believed.axis))
    return Retuned("force_constant", was, value)


def widening(clear: Floats, family: int) -> float:
    """Return by how much intervals widen when only numbers that moved beyond them are told.

    `clear` are the moves in half widths of plain 95 % intervals, of a `family` of numbers.
    """
    from scipy.stats import t as student

    order = np.sort(clear)[::-1]
    for told in range(family, 0, -1):
        wider = float(student.ppf(1.0 - 0.025 * told / family, FREEDOM)) / WIDE
        if order[told - 1] > wider:
            return wider
    return np.inf


def _pulled(believed: Stage, refined: Refined, values: Floats) -> Floats:
    """Return how each of `_numbers` changes with a step of each knob, (5, q), with what is folded into it."""
    pulled = USUAL * values[:, None] * refined.away
    for k, knob in enumerate(refined.knobs):
        name = refined.entries[knob.entry]["name"]
        if name == "inertia":
            pulled[0, k] += values[0] * knob.step / knob.of(refined.entries)
        elif name == "viscous-friction" and believed.mechanics.viscous > 0:
            pulled[1, k] += knob.step
    return pulled


def _numbers(fitted: Fitted, c: Floats) -> Floats:
    """Return mass, viscous friction, micro-damping, level and reach of friction of coefficients `c`."""
    reaches = fitted.ledger.reaches
    elements = list(zip(c[3 : 3 + reaches.size], reaches, strict=True))
    return np.array([c[0], c[1], c[2], *level_and_reach(elements)])
