"""Numbers of the belief that moved: which are told, and how surely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtcomp.diagnosis.forces.models import levels
from rtcomp.diagnosis.forces.reaches import elements_of
from rtcomp.diagnosis.result import Retuned, Value
from rtcomp.kernels import Floats
from rtcomp.physics.yielding import yielded
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis, power_of

MOVED = 0.02
"""Relative change of a parameter that is worth reporting."""
NONE = np.zeros(0)
EXPONENT = "friction.exponent"
CURVE = 200
"""Points of a virgin curve that is not straight between the reaches of its elements."""
FREEDOM, WIDE = 9, 2.262
"""Degrees of freedom of about ten blocks, and standard deviations of a 95 % interval from them (Student)."""


@dataclass(frozen=True)
class Numbers:
    """Mass, viscous friction, micro-damping, level and reach of friction, believed and found, (5,) each.

    Sizes of forces of believed effects may follow.
    """

    before: Floats
    values: Floats
    half: Floats
    """Half widths of plain 95 % intervals."""
    units: tuple[str, ...] = ("kg", "N s/m", "N s/m", "N", "m")
    """As a linear axis has them."""

    def in_units(self, unit: str, factor: float) -> Numbers:
        """Return them with those found in another `unit`, times `factor` for each in their unit."""
        times = factor ** np.array([power_of(unit, of) for of in self.units], dtype=float)
        return replace(self, values=times * self.values, half=times * self.half)


def retunings(numbers: Numbers, axis: str) -> list[Retuned]:
    """Return the believed parameters that the fit moved, with their 95 % intervals.

    Numbers are told because they moved: of so chosen ones, plain intervals miss more than a twentieth.
    Theirs are wider by how few were chosen (Benjamini and Yekutieli 2005, J. American Statistical
    Association 100(469)).
    """
    before, values, half = numbers.before, numbers.values, numbers.half
    names = ("mass", "viscous", "micro_damping", "friction.level", "friction.reach")
    moved = np.abs(values - before)
    tell = (before > 0) & (moved > MOVED * before)
    clear = np.where(tell, moved / np.maximum(half, 1e-300), 0.0)
    wider = widening(clear, int(np.count_nonzero(before > 0)))
    found = []
    for i in np.flatnonzero(clear > wider).tolist():
        new, size = float(values[i]), float(wider * half[i])
        value = Value(new, max(new - size, 0.0), new + size, for_axis(numbers.units[i], axis))
        found.append(Retuned(names[i], float(before[i]), value))
    return found


def widening(clear: Floats, family: int) -> float:
    """Return by how much intervals widen when only numbers that moved beyond them are told.

    `clear` are the moves in half widths of plain 95 % intervals, of a `family` of numbers.
    """
    from scipy.special import stdtrit

    order = np.sort(clear)[::-1]
    for told in range(family, 0, -1):
        wider = float(stdtrit(FREEDOM, 1.0 - 0.025 * told / family)) / WIDE
        if order[told - 1] > wider:
            return wider
    return np.inf


def level_and_reach(
    elements: Sequence[Sequence[float]], models: Floats = NONE, exponent: float = 0.0
) -> tuple[float, float]:
    """Return friction.level (N, sum of yield forces) and friction.reach (m, travel to half of it).

    An element is its stiffness (N/m) and its reach (m), and yields by Dahl's law of an `exponent`. Beside
    `models` of friction, by their levels (N), there is no reach: 0.
    """
    k, r = np.array([e[0] for e in elements]), np.array([e[1] for e in elements])
    level = float(np.sum(k * r))
    travel = np.concatenate([[0.0], np.sort(r)])
    if exponent != 0.0:  # curved between them
        travel = np.append(0.0, np.geomspace(0.1 * travel[1], travel[-1], CURVE))
    force = np.array(
        [sum(a * yielded(0.0, x, b, exponent) for a, b in zip(k, r, strict=True)) for x in travel]
    )
    reach = 0.0 if models.size else float(np.interp(0.5 * level, force, travel))
    return level + float(np.sum(models)), reach


def law(believed: Stage, found: Stage) -> list[Retuned]:
    """Return the law by which friction yields, where that found is another than the believed one."""
    (elements, before), (_, after) = (elements_of(stage) for stage in (believed, found))
    return (
        []
        if before == after or not elements
        else [Retuned(EXPONENT, before, Value(after, after, after, "1"))]
    )


def believed_friction(stage: Stage) -> tuple[float, float]:
    """Return friction.level (N) and friction.reach (m) of the belief; 0 where it has none."""
    elements, exponent = elements_of(stage)
    if elements:
        return level_and_reach(elements, exponent=exponent)
    return float(np.sum(levels(stage))), 0.0
