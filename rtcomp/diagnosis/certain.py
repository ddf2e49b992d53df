"""How certain the numbers of a fit are: by scatter over blocks, by the grid of reaches, by how models model.

A residual that is alike for long does not count as many samples: scores are summed over blocks of the
recording, and neighbouring blocks are taken to be alike. What the grid of reaches decides is seen on grids
beside it that fit nearly as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis.base import BELIEVED, Fitted, fit_base
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.extend import level_and_reach
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.refine import Knob, Refined, refine
from rtcomp.diagnosis.result import Retuned, Value
from rtcomp.kernels import Floats
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis

MODEL = 0.015
"""Relative half width of an interval that no data removes: kernels are models, rows are discrete. As much as
trials' plants of other physics were missed by where all else was certain."""
BESIDE = (0.85, 1.18)
"""Factors on the reaches of the grids that a fit is held against."""
MOVED = 0.02
"""Relative change of a parameter that is worth reporting."""
WIDE = 2.26
"""Standard deviations of a 95 % interval from about ten blocks (Student)."""


def neighbours(stage: Stage, motion: Motion, refined: Refined) -> list[Refined]:
    """Return the same entries refined on the grids of reaches beside the one that fits best."""
    effects = [effect_of(e) for e in refined.entries]
    found = []
    for factor in BESIDE:
        base = fit_base(stage, motion, scales=(refined.fitted.scale * factor,), effects=effects)
        found.append(refine(base, motion, refined.entries, tries=3))
    return found


def birge(final: Fitted, floor: Floats) -> float:
    """Return the factor on every interval by which a fit is worse than noise, at least 1.

    Where something is left that no noise leaves, the model is not quite the physics, and its numbers are as
    far off as that; Birge (1932), Physical Review 40.
    """
    return max(1.0, float(np.sqrt(final.errors.sum() / max(float(floor.sum()), 1e-300))))


def _weight(best: Fitted, other: Fitted) -> float:
    """Return how much a fit beside counts: less, the worse it is."""
    return min(float(best.errors.sum()) / max(float(other.errors.sum()), 1e-300), 1.0)


def intervals(
    refined: Refined, beside: Sequence[Refined], worse: float = 1.0
) -> dict[tuple[int, str], tuple[float, float]]:
    """Return the 95 % interval of every knob, by entry number and name; `worse` widens them (`birge`)."""
    from scipy.stats import t as student

    ledger = refined.fitted.ledger
    row = ledger.motion.period
    times = [(i, float(e["time"])) for i, e in enumerate(refined.entries) if "time" in e]  # type: ignore[arg-type]
    found = {(i, "time"): (t - row, t + row) for i, t in times}
    if not refined.knobs:
        return found
    block = ledger.block[ledger.seen[ledger.block]]
    j, r = refined.jacobian, refined.residual
    gram = j.T @ j
    scores = np.array([j[block == b].T @ r[block == b] for b in np.unique(block)])
    count = scores.shape[0]
    # Newey and West (1987), Econometrica 55(3), with one lag.
    mixed = scores[1:].T @ scores[:-1]
    meat = (scores.T @ scores + 0.5 * (mixed + mixed.T)) * count / max(count - 1, 1)
    told = gram @ np.linalg.pinv(meat, rcond=1e-12) @ gram
    spread = np.linalg.pinv(told + refined.away.T @ refined.away, rcond=1e-12)
    factor = float(student.ppf(0.975, max(count - 1, 1)))
    for k, knob in enumerate(refined.knobs):
        value = _value(refined, knob)
        sd = float(np.sqrt(max(spread[k, k], 0.0)))
        grid = max(
            (_weight(refined.fitted, b.fitted) * _apart(knob, _value(b, knob), value) for b in beside),
            default=0.0,
        )
        size = 2.0 if knob.parameter.name == "phase" else abs(value)
        half = worse * float(np.sqrt((factor * sd * knob.step) ** 2 + grid**2 + (MODEL * size) ** 2))
        low, high = knob.parameter.low, knob.parameter.high  # what it may be at all
        found[knob.entry, knob.parameter.name] = (max(value - half, low), min(value + half, high))
    return found


def _value(refined: Refined, knob: Knob) -> float:
    return float(refined.entries[knob.entry][knob.parameter.name])  # type: ignore[arg-type]


def _apart(knob: Knob, one: float, other: float) -> float:
    if knob.parameter.name == "phase":
        return float(abs((one - other + np.pi) % (2 * np.pi) - np.pi))
    return abs(one - other)


def retunings(
    believed: Stage, final: Fitted, beside: Sequence[Refined], extended: Stage, worse: float = 1.0
) -> list[Retuned]:
    """Return the believed parameters that the fit moved, with their 95 % intervals."""
    seen = final.ledger.seen
    members = np.flatnonzero(seen)
    sets = [_numbers(final, final.coefficients)]
    for k in members:
        others = seen.copy()
        others[k] = False
        sets.append(_numbers(final, final.system.blocks.coefficients(others, final.bounds)))
    table = np.array(sets)
    count = members.size
    spread = np.sqrt((count - 1) / count * np.sum((table[1:] - table[1:].mean(axis=0)) ** 2, axis=0))
    grid = np.zeros(table.shape[1])
    for b in beside:
        apart = np.abs(_numbers(b.fitted, b.fitted.coefficients) - table[0])
        grid = np.maximum(grid, _weight(final, b.fitted) * apart)
    m, now = believed.mechanics, extended.mechanics
    table[0, :2] = now.mass, now.viscous  # with what was folded into them
    friction = believed.friction
    own = level_and_reach(friction.elements) if isinstance(friction, MaxwellSlip) else (0.0, 0.0)
    before = [m.mass, m.viscous, m.micro_damping, *own]
    names = ("mass", "viscous", "micro_damping", "friction.level", "friction.reach")
    units = ("kg", "N s/m", "N s/m", "N", "m")
    found = []
    for i, (name, unit, old) in enumerate(zip(names, units, before, strict=True)):
        new = float(table[0, i])
        half = worse * float(np.sqrt((WIDE * spread[i]) ** 2 + grid[i] ** 2 + (MODEL * new) ** 2))
        if i < 3 and old > 0 and abs(abs(new / old - 1.0) / BELIEVED - 1.0) < 0.05:
            half = max(half, BELIEVED * old)  # held there by the belief, not by the recording
        if old > 0 and abs(new / old - 1) > MOVED and abs(new - old) > half:
            value = Value(new, max(new - half, 0.0), new + half, for_axis(unit, believed.axis))
            found.append(Retuned(name, float(old), value))
    return found


def _numbers(fitted: Fitted, c: Floats) -> Floats:
    """Return mass, viscous friction, micro-damping, level and reach of friction of coefficients `c`."""
    reaches = fitted.ledger.reaches
    elements = list(zip(c[3 : 3 + reaches.size], reaches, strict=True))
    return np.array([c[0], c[1], c[2], *level_and_reach(elements)])
