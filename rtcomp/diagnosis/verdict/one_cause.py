"""Whether numbers of the belief that moved have one cause: another unit of force, or of length."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.fitting.retuned import MOVED, WIDE, Numbers
from rtcomp.diagnosis.result import Retuned, Value
from rtcomp.diagnosis.settings import BELIEF_SD, LEVEL
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis, power_of

FORCE, LENGTH = "N", "m"
OFF = np.geomspace(1e-3, BELIEF_SD, 20)
"""How far numbers of a belief may be off each by itself, relative (standard deviations, equally likely)."""
WRONG = 1.0
"""How far a number is off, in its logarithm (standard deviation), that is not off but wrong: the reach of a
friction of another shape, a mass without its load. One in a hundred is (LEVEL)."""
MOST_WRONG = 3
"""Numbers of a belief that may be wrong at once."""


@dataclass(frozen=True)
class Cause:
    """A unit by which all numbers moved, each as often as it has the unit."""

    unit: str
    factor: float
    """True over believed unit: the true size of what was believed to be 1."""
    low: float
    high: float
    """95 % interval of the factor."""
    probability: float
    """That numbers moved by it, and not each by itself."""


def one_cause(numbers: Numbers, fixed: Iterable[str]) -> Cause | None:
    """Return the unit that moved, None where numbers may have moved each by itself.

    A recording of voltage and position says nothing of the unit of force, which is a force constant, nor of
    that of length, which is a scale of the sensor: all numbers that have it move by its factor. Marginal
    likelihoods of the logarithms tell one cause from many: beside a factor, a belief is off by less. Any
    number may be wrong besides (contaminated normal law: Tukey 1960), which says nothing of the others.
    Something of the belief that cannot move is measured in the units that are `fixed`.
    """
    known = (numbers.before > 0.0) & (numbers.values > 0.0)
    before, values = numbers.before[known], numbers.values[known]
    moved = np.log(values / before)
    sd = numbers.half[known] / WIDE / values
    causes = [unit for unit in (FORCE, LENGTH) if unit not in set(fixed)]
    powers = [np.array([power_of(unit, u) for u in numbers.units], dtype=float)[known] for unit in causes]
    each = float(_likelihoods(moved, sd, np.zeros(moved.size))[0].sum())
    found = [_by_factor(moved, sd, -power) for power in powers]
    total = each + sum(likelihood for likelihood, _, _ in found)
    if not total > 0.0:
        return None
    for unit, (likelihood, mean, deviation) in zip(causes, found, strict=True):
        probability = float(likelihood / total)
        if probability > 1.0 - LEVEL and abs(mean) > MOVED:
            low, high = (math.exp(mean + side * 1.96 * deviation) for side in (-1.0, 1.0))
            return Cause(unit, math.exp(mean), low, high, probability)
    return None


def fixed_units(believed: Stage) -> list[str]:
    """Return the units in which a belief has numbers that a fit does not move, or that it gives already."""
    found = []
    for effect in believed.mechanics.effects:
        kind = ent.kind_of(effect)
        moves = kind.linear if ent.adds_force(kind) else ()
        still = [p.unit for p in kind.parameters if p.name not in moves]
        # What is given by a list, as a curve through points, stays as it is.
        listed = bool(kind.element) or not kind.parameters
        found += [unit for unit in (FORCE, LENGTH) if listed or any(power_of(unit, u) for u in still)]
        found += [LENGTH] if ent.turns(dict(effect)) else []
        found.append(kind.other_unit)
    return found


def force_constant(believed: Stage, cause: Cause) -> Retuned:
    """Return another force constant in the place of forces that all moved by one factor."""
    was = believed.force_constant
    value = Value(was * cause.factor, was * cause.low, was * cause.high, for_axis("N/V", believed.axis))
    return Retuned("force_constant", was, value)


def _by_factor(moved: Floats, sd: Floats, power: Floats) -> tuple[float, float, float]:
    """Return likelihood, and mean and standard deviation of the logarithm of a factor."""
    likelihood, mean, variance = _likelihoods(moved, sd, power)
    total = float(likelihood.sum())
    weight = likelihood / max(total, 1e-300)
    centre = float(np.sum(weight * mean))
    return total, centre, math.sqrt(float(np.sum(weight * (variance + (mean - centre) ** 2))))


def _likelihoods(moved: Floats, sd: Floats, power: Floats) -> tuple[Floats, Floats, Floats]:
    """Return density of what `moved` times prior, and mean and variance of the factor's logarithm given that.

    For each of `OFF` and each choice of numbers that are wrong, (O, C). Numbers are known to `sd` (q,), and
    a factor whose logarithm has the standard deviation BELIEF_SD moves them by these powers (q,).
    """
    some = [c for k in range(MOST_WRONG + 1) for c in combinations(range(moved.size), k)]
    wrong = np.array([np.isin(np.arange(moved.size), c) for c in some])
    prior = np.where(wrong, LEVEL, 1.0 - LEVEL).prod(axis=1) / OFF.size
    variance = sd**2 + np.where(wrong, WRONG, OFF[:, None, None]) ** 2
    told = 1.0 / BELIEF_SD**2 + np.sum(power**2 / variance, axis=-1)
    mean = np.sum(power * moved / variance, axis=-1) / told
    square = np.sum(moved**2 / variance, axis=-1) - mean**2 * told
    determinant = np.sum(np.log(variance), axis=-1) + np.log(told * BELIEF_SD**2)
    return prior * np.exp(-0.5 * (square + determinant)), mean, 1.0 / told
