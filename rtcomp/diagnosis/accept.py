"""Which entries count: what they explain is no accident, and does not trim what is named already.

All are judged by the squared errors (N^2) of blocks that were left out, before and after, and by the floor:
what noise and method would leave of them.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rtcomp.kernels import Floats

LEAST_SHARE = 0.04
"""Part of the present squared error that an entry must explain to be worth naming."""
STEADY = 0.8
"""Part of the blocks in which it must do no harm,"""
AMENDS = 0.15
"""unless all harm together is less than this part of what it gains: two effects may hide in each other."""
FEW = 3
"""Blocks that must gain."""
ABOVE_FLOOR = 1.6
"""Squared error over the floor's, below which nothing is missing."""
NEAR = 2.5
"""Squared error over the floor's, below which a free curve must stand out: it fits rounding as well."""
SETTLED = 0.004
"""Part of what entries explain, below which what is left is how their kernels model, not physics."""
EXACT = (
    "back-emf", "asymmetric-viscous-friction", "constant-force", "drive-deadband", "drive-offset",
    "drive-saturation", "gravity", "parallel-spring", "quadratic-drag", "tonal-disturbance",
    "viscous-friction",
)  # fmt: skip
"""Entries whose kernels leave nothing of what they stand for, however much that is."""
BESIDE, MORE, MOST_OF_IT = 0.15, 0.3, 0.5
"""Part of what the entries before it explain, from which on a further entry counts beside them, and the part
of what is left that it must explain then: in general, and where it is large only beside what of them is not
exact;"""
REST = 0.6
"""part of what is left that it must explain else,"""
LEAST_BESIDE = 0.05
"""and part of what those before it explain,"""
ALL = 0.85
"""unless it explains this part of all that is left: what is wrong with the first is not so well explained."""
ELSE, SURPLUS, MOST = 1.2, 0.45, 0.7
"""Times what the kernels of those before it leave of them, above which something else may be left; times that
and the part of what is beyond it that a further entry must gain to be that."""
NOISE, STEADILY = 0.7, 0.4
"""Times the floor that an entry must gain to be worth naming: in general, and where nearly all blocks gain
and it explains most of what is left."""
DISTINCT, DOUBTLESS, MOST_BLOCKS = 0.2, 3.0, 0.75
"""Part of the error that an entry must explain where the level of it says nothing, standard errors of the
logarithm of what it leaves of a block, and the part of the blocks that must gain."""
MAINLY = 0.5
"""That part where the error is so small that how contacts are modelled leaves as much: something that is not
there explains up to a quarter of it."""
SURE = 8.0
"""Standard errors of what it gains, in nearly all blocks, from which on it counts beside others as well."""


def worth_it(before: Floats, after: Floats, floor: Floats) -> bool:
    """Tell whether the step from `before` to `after` (squared errors of blocks) is no accident."""
    gained = before - after
    share = float(gained.sum() / before.sum())
    # An effect may show in a few stretches only; what matters is that it does no harm in the others.
    harmless = float(np.mean(gained > -0.05 * before - floor)) >= STEADY
    harmless = harmless or -float(np.minimum(gained, 0.0).sum()) < AMENDS * float(gained.sum())
    helped = int(np.count_nonzero(gained > 0.05 * before))
    scatter = float(gained.std(ddof=1) / np.sqrt(gained.size))
    excess = float(before.sum() - floor.sum())
    broad = helped >= FEW and (float(gained.mean()) > 1.2 * scatter or helped > 0.4 * gained.size)
    plain = share > 0.5 and float(gained.sum()) > 5.0 * float(floor.sum())
    throughout = helped >= 0.8 * gained.size and float(gained.sum()) > 0.5 * excess
    return (
        share > LEAST_SHARE
        and harmless
        and (broad or plain)
        and float(gained.sum()) > 0.05 * excess
        and float(gained.sum()) > (STEADILY if throughout else NOISE) * float(floor.sum())
    )


def stands_out(before: Floats, after: Floats, distinct: float = DISTINCT) -> bool:
    """Tell whether the step from `before` to `after` is no accident, wherever their level is.

    It must be gone by the part `distinct` at least.

    A floor is only as good as the double that it comes from, and a level above it adds up all that is wrong
    in small. What has the shape of an entry is gone from nearly every block that was left out.
    """
    gained = before - after
    ratio = np.log(np.maximum(before, 1e-300) / np.maximum(after, 1e-300))
    doubt = float(ratio.std(ddof=1) / np.sqrt(ratio.size))
    return (
        float(gained.sum()) > distinct * float(before.sum())
        and float(ratio.mean()) > DOUBTLESS * doubt
        and float(np.mean(gained > 0.05 * before)) >= MOST_BLOCKS
    )


def is_the_rest(before: Floats, after: Floats, floor: Floats) -> bool:
    """Tell whether the step from `before` to `after` is most of what is left, in some blocks, at no harm.

    So it is with one number that names had to do for: where it matters it is gone, elsewhere nothing is.
    """
    gained = before - after
    total, whole = float(gained.sum()), float(before.sum())
    return (
        total > max(DISTINCT * whole, MOST_OF_IT * (whole - float(floor.sum())))
        and int(np.count_nonzero(gained > 0.05 * before)) >= FEW
        and -float(np.minimum(gained, 0.0).sum()) < AMENDS * total
    )


def modelled(names: Iterable[str], gains: Iterable[float]) -> float:
    """Return what is explained by entries whose kernels leave something of it, of `gains` by `names`."""
    return sum(gain for name, gain in zip(names, gains, strict=True) if name not in EXACT)


def settles_the_rest(
    named: float, before: Floats, after: Floats, floor: Floats, shapeless: bool = False, exact: float = 0.0
) -> bool:
    """Tell whether a further entry has a weight of its own, not one that trims how others are modelled.

    `named` is what those before it explain (`modelled`), `exact` what the others of them do. All that they
    leave is no such weight where the entry is `shapeless`: a free curve trims anything.
    """
    gained = float(before.sum() - after.sum())
    of_rest = gained / float(max(before.sum() - floor.sum(), 1e-300))
    beside = gained / max(named, 1e-300)
    each = before - after
    more = MORE if gained > BESIDE * (named + exact) else MOST_OF_IT
    steady = float(each.mean()) > SURE * float(each.std(ddof=1) / np.sqrt(each.size))
    everywhere = steady and bool(np.mean(each > 0.05 * before) >= 0.9)
    return (
        (of_rest > ALL and not shapeless)
        or (beside > BESIDE and of_rest > more)
        or (beside > LEAST_BESIDE and (of_rest > REST or everywhere))
    )


def is_something_else(before: Floats, after: Floats, left: Floats, chance: float) -> bool:
    """Tell whether a further entry explains most of what the kernels of those before it do not leave.

    `left` is what they do leave, and `chance` what the entry gains of that (`Double`).
    """
    gained = float(before.sum() - after.sum()) - chance
    return gained > max(SURPLUS * float(left.sum()), MOST * float(before.sum() - left.sum()))
