"""Whether numbers of the belief that moved have one cause: another unit of force, or of length."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.result import Retuned, Value
from rtcomp.diagnosis.retuned import MOVED, WIDE, Numbers
from rtcomp.diagnosis.settings import BELIEF_SD, LEVEL
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis, power_of

FORCE, LENGTH = "N", "m"
OFF = np.geomspace(1e-3, BELIEF_SD, 20)
"""How far numbers of a belief may be off each by itself, relative (standard deviations, equally likely)."""


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
    likelihoods of the logarithms tell one cause from many: beside a factor, a belief is off by less.
    Something of the belief that cannot move is measured in the units that are `fixed`.
    """
    known = (numbers.before > 0.0) & (numbers.values > 0.0)
    before, values = numbers.before[known], numbers.values[known]
    moved = np.log(values / before)
    sd = numbers.half[known] / WIDE / values
    causes = [unit for unit in (FORCE, LENGTH) if unit not in set(fixed)]
    powers = [np.array([power_of(unit, u) for u in numbers.units], dtype=float)[known] for unit in causes]
    each = np.mean([_likelihood(moved, sd, off, np.zeros(moved.size))[0] for off in OFF])
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
        found.append(kind.other_unit)
    return found


def force_constant(believed: Stage, cause: Cause) -> Retuned:
    """Return another force constant in the place of forces that all moved by one factor."""
    was = believed.force_constant
    value = Value(was * cause.factor, was * cause.low, was * cause.high, for_axis("N/V", believed.axis))
    return Retuned("force_constant", was, value)


def _by_factor(moved: Floats, sd: Floats, power: Floats) -> tuple[float, float, float]:
    """Return likelihood, and mean and standard deviation of the logarithm of a factor, over all of `OFF`."""
    found = np.array([_likelihood(moved, sd, off, power) for off in OFF])
    weight = found[:, 0] / max(float(found[:, 0].sum()), 1e-300)
    mean = float(weight @ found[:, 1])
    spread = float(weight @ (found[:, 2] + (found[:, 1] - mean) ** 2))
    return float(found[:, 0].mean()), mean, math.sqrt(spread)


def _likelihood(moved: Floats, sd: Floats, off: float, power: Floats) -> tuple[float, float, float]:
    """Return the density of what `moved`, and mean and variance of the factor's logarithm given that.

    Numbers are known to `sd`, a belief is `off` by itself, and by a factor of BELIEF_SD to these powers.
    """
    variance = sd**2 + off**2
    told = 1.0 / BELIEF_SD**2 + float(np.sum(power**2 / variance))
    mean = float(np.sum(power * moved / variance)) / told
    square = float(np.sum(moved**2 / variance)) - mean**2 * told
    determinant = float(np.sum(np.log(variance))) + math.log(told * BELIEF_SD**2)
    return math.exp(-0.5 * (square + determinant)), mean, 1.0 / told
