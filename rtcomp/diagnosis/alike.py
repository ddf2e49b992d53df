"""Which names this recording cannot tell apart, and which of them to prefer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis.base import Fitted
from rtcomp.diagnosis.departure import departure
from rtcomp.diagnosis.refine import Refined
from rtcomp.kernels import Floats

APART = 1.6
"""Factor on the error with the best name, beyond which another name is told apart from it."""
FURTHER = 3.0
"""How much further (see `departure`) a name may take the believed numbers than the best one."""
ALIKE = 0.06
"""Names are not told apart where they differ by less than this part of what the best explains."""
PLAINER = {"asymmetric-viscous-friction": "viscous-friction"}
"""Entries that are another one and more,"""
NEEDLESS = 1.25
"""and the factor on their error up to which the plainer one is taken."""
SHAPELESS = ("position-force",)
"""Entries that take any shape: a name with a shape of its own is preferred where it explains as much."""
ONE_THING = (
    ("drive-offset", "constant-force", "gravity"),
    ("viscous-friction", "back-emf"),
)
"""Entries that are the same force on any recording of this kind: only what is tried is listed first."""


def last(refined: Refined) -> str:
    """Return the name of the entry that was added last."""
    return str(refined.entries[-1]["name"])


def plainest(tried: Sequence[Refined]) -> list[Refined]:
    """Return the contenders, best first, without those of which a plainer one explains nearly as much."""
    errors = {last(r): float(r.errors.sum()) for r in tried}
    needless = {
        name
        for name, plain in PLAINER.items()
        if errors.get(plain, np.inf) < NEEDLESS * errors.get(name, 0.0)
    }
    kept = [r for r in tried if last(r) not in needless]
    return sorted(kept, key=lambda r: float(r.errors.sum()))


def least_far(tried: Sequence[Refined], current: Fitted) -> Refined:
    """Return, of those that explain as much as the first, the one that leaves the belief most as it is."""
    best = tried[0]
    nearest = departure(best.fitted)
    reduction = float(current.errors.sum() - best.errors.sum())
    for other in tried[1:]:
        lost = float(other.errors.sum() - best.errors.sum())
        if last(other) in SHAPELESS or lost > 0.5 * ALIKE * reduction:
            continue
        if float(other.errors.sum()) > APART * float(tried[0].errors.sum()):
            continue
        away = departure(other.fitted)
        if away < nearest - FURTHER:
            best, nearest = other, away
    return best


def alike(best: Refined, rest: Sequence[Refined], current: Fitted, floor: Floats) -> tuple[list[str], float]:
    """Return all names that explain as much as the best one, likeliest first, and the best one's share."""
    reduction = current.errors - best.errors
    most = APART * float(best.errors.sum()) + 0.5 * float(floor.sum())
    away = departure(best.fitted) + FURTHER
    names, weights = [last(best)], [1.0]
    for other in rest:
        name = last(other)
        if name in SHAPELESS or name in names:
            continue
        if float(other.errors.sum()) > most or departure(other.fitted) > away:
            continue
        worse = other.errors - best.errors
        scatter = float(worse.std(ddof=1) * np.sqrt(worse.size))
        lost = float(worse.sum() / max(reduction.sum(), 1e-300))
        doubt = 2.0 * scatter + 0.005 * float(reduction.sum()) + 0.2 * float(floor.sum())
        if lost < ALIKE and float(worse.sum()) < doubt:
            names.append(name)
            weights.append(float(np.exp(-max(lost, 0.0) / (0.3 * ALIKE))))
    for group in ONE_THING:
        if names[0] in group[:2]:
            names += [g for g in group if g not in names]
            weights += [0.5] * (len(names) - len(weights))
    return names, float(weights[0] / sum(weights))
