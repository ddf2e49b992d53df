"""Which names this recording cannot tell apart, and which of them to prefer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis.base import BELIEVED, Fitted
from rtcomp.diagnosis.departure import departure
from rtcomp.diagnosis.refine import Refined
from rtcomp.kernels import Floats

APART = 1.6
"""Factor on the error with the best name, beyond which another name is told apart from it."""
STEADILY, CLEARLY = 1.15, 4.0
"""That factor where every block has its part of it, and the standard errors by which its mean logarithm over
the blocks is above none then."""
LATE = ("drive-delay", "drive-lag", "sensor-delay")
"""Entries that differ by how rows sample them: which does better need not be right."""
FURTHER = 3.0
"""How much further (see `departure`) a name may take the believed numbers than the best one."""
NO_FURTHER = 1.0
"""How much further one number of another value may take the others than what scales all of them a little."""
ALIKE = 0.06
"""Names are not told apart where they differ by less than this part of what the best explains."""
PLAINER = {"asymmetric-viscous-friction": "viscous-friction", "resonance": "inertia"}
"""Entries that are another one and more,"""
NEEDLESS = 1.25
"""and the factor on their error up to which the plainer one is taken;"""
LOOSE = 2.0
"""Hz below which a second mass hangs so loosely that it stays where it is: that much less mass, no more."""
SHAPELESS = ("position-force",)
"""Entries that take any shape: a name with a shape of its own is preferred where it explains as much."""
ONE_THING = (
    ("drive-offset", "constant-force", "gravity"),
    ("viscous-friction", "back-emf"),
)
"""Entries that are the same force on any recording of this kind: only what is tried is listed first."""
SCALES_ALL = {"drive-gain": "gain", "sensor-scale": "scale"}
"""Entries that scale all believed numbers together, and the parameter that says by how much."""
ONE_NUMBER = ("inertia", "viscous-friction")
"""Entries that only give one believed number another value."""


def last(refined: Refined) -> str:
    """Return the name of the entry that was added last."""
    return str(refined.entries[-1]["name"])


def plainest(tried: Sequence[Refined]) -> list[Refined]:
    """Return the contenders, best first, without those of which a plainer one explains nearly as much."""
    errors = {last(r): float(r.errors.sum()) for r in tried}
    kept = [
        r
        for r in tried
        if errors.get(PLAINER.get(last(r), ""), np.inf) >= NEEDLESS * float(r.errors.sum()) or _rings(r)
    ]
    return sorted(kept, key=lambda r: float(r.errors.sum()))


def _rings(refined: Refined) -> bool:
    """Tell whether the last entry is a second mass that does move."""
    entry = refined.entries[-1]
    return entry["name"] == "resonance" and float(entry["frequency"]) > LOOSE  # type: ignore[arg-type]


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
        if away < nearest - FURTHER or (_scales_little(best) and _one_number(other, nearest)):
            best, nearest = other, away
    return best


def bounded(best: Refined, tried: Sequence[Refined], current: Fitted) -> Refined:
    """Return `best`, or of those not told apart from it one whose force does not run away beyond the motion.

    A spring that pushes outwards pushes without end; over less than a period, a wave does the same.
    """
    if not _runs_away(best):
        return best
    most = float(best.errors.sum())
    most = min(APART * most, most + ALIKE * float(current.errors.sum() - most))
    others = [r for r in tried if last(r) not in SHAPELESS and not _runs_away(r)]
    return next((r for r in others if float(r.errors.sum()) <= most), best)


def _runs_away(refined: Refined) -> bool:
    """Tell whether the last entry is a spring that pushes outwards, somewhere."""
    if last(refined) != "parallel-spring":
        return False
    entry = refined.entries[-1]
    return any(float(entry[part]) < 0.0 for part in ("stiffness", "cubic"))  # type: ignore[arg-type]


def _scales_little(refined: Refined) -> bool:
    """Tell whether the last entry scales all numbers by no more than each of them may be off anyway."""
    size = SCALES_ALL.get(last(refined))
    return size is not None and abs(float(refined.entries[-1][size]) - 1.0) < BELIEVED  # type: ignore[arg-type]


def _one_number(refined: Refined, nearest: float) -> bool:
    """Tell whether the last entry is another value of one number, which leaves the others as believed."""
    return last(refined) in ONE_NUMBER and departure(refined.fitted) < nearest + NO_FURTHER


def steadily_worse(best: Floats, other: Floats) -> bool:
    """Tell whether one entry leaves more (squared errors of blocks) than another, by a little but everywhere.

    What differs in total may be an accident of the loudest blocks; what differs in each is none.
    """
    ratio = np.log(np.maximum(other, 1e-300) / np.maximum(best, 1e-300))
    doubt = float(ratio.std(ddof=1) / np.sqrt(ratio.size))
    return float(other.sum()) > STEADILY * float(best.sum()) and float(ratio.mean()) > CLEARLY * doubt


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
        if steadily_worse(best.errors, other.errors) and not {name, names[0]} <= set(LATE):
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
