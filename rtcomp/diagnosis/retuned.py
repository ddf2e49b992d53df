"""Numbers of the belief that moved: which are told, how surely, and whether all moved by one factor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.result import Retuned, Value
from rtcomp.kernels import Floats
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis

MOVED = 0.02
"""Relative change of a parameter that is worth reporting."""
SEVERAL = 3
"""Numbers that must have moved for it to be said that all did."""
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


def retunings(numbers: Numbers, axis: str) -> list[Retuned]:
    """Return the believed parameters that the fit moved, with their 95 % intervals.

    Numbers are told because they moved: of so chosen ones, plain intervals miss more than a twentieth.
    Theirs are wider by how few were chosen (Benjamini and Yekutieli 2005, J. American Statistical
    Association 100(469)).
    """
    before, values, half = numbers.before, numbers.values, numbers.half
    names = ("mass", "viscous", "micro_damping", "friction.level", "friction.reach")
    units = ("kg", "N s/m", "N s/m", "N", "m")
    moved = np.abs(values - before)
    tell = (before > 0) & (moved > MOVED * before)
    clear = np.where(tell, moved / np.maximum(half, 1e-300), 0.0)
    wider = widening(clear, int(np.count_nonzero(before > 0)))
    found = []
    for i in np.flatnonzero(clear > wider).tolist():
        new, size = float(values[i]), float(wider * half[i])
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
    open_by = np.maximum(half, 1e-9)
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
    from scipy.special import stdtrit

    order = np.sort(clear)[::-1]
    for told in range(family, 0, -1):
        wider = float(stdtrit(FREEDOM, 1.0 - 0.025 * told / family)) / WIDE
        if order[told - 1] > wider:
            return wider
    return np.inf


def level_and_reach(elements: Sequence[Sequence[float]]) -> tuple[float, float]:
    """Return friction.level (N, sum of yield forces) and friction.reach (m, travel to half of it).

    An element is its stiffness (N/m) and its reach (m).
    """
    k, r = np.array([e[0] for e in elements]), np.array([e[1] for e in elements])
    level = float(np.sum(k * r))
    travel = np.concatenate([[0.0], np.sort(r)])
    force = np.array([float(np.sum(k * np.minimum(x, r))) for x in travel])
    return level, float(np.interp(0.5 * level, force, travel))


def believed_friction(stage: Stage) -> tuple[float, float]:
    """Return friction.level (N) and friction.reach (m) of the belief; 0 where it has no stop elements."""
    friction = stage.friction
    return level_and_reach(friction.elements) if isinstance(friction, MaxwellSlip) else (0.0, 0.0)
