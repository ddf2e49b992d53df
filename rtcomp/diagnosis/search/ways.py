"""Two ways to take the command between rows: what models of each leave, on the same footing.

Each way has a force balance of its own, which weighs frequencies by its own response and may reserve other
blocks. So models of both are compared on the blocks that neither reserves, and by the force as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.candidates.growing import in_better_form
from rtcomp.diagnosis.fitting.baseline import settle
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.settings import LEAST_GAIN


@dataclass(frozen=True)
class Left:
    """What a model leaves of what there is to explain, both squared: the logarithm of its part."""

    weighed: float
    """Of the residual, each frequency weighed by its noise, on blocks left out."""
    force: float
    """Of the force, above the noise."""

    @classmethod
    def by(cls, fitter: Fitter, model: Fitted, blocks: np.ndarray) -> Left:
        """Measure it on some `blocks`, (B,) bool, none of them reserved."""
        of_blocks = model.errors[blocks[np.flatnonzero(fitter.use)]]
        force = max(fitter.relative(model, seen=True), 1e-150)
        return cls(float(np.mean(np.log(of_blocks / fitter.balance.power_of(blocks)))), 2.0 * math.log(force))


def alike(one: ForceBalance, other: ForceBalance) -> list[np.ndarray]:
    """Return the blocks, (B,) bool, on which models of each are compared: those that neither reserves.

    Where both are not cut alike, all that each does not reserve.
    """
    if one.blocks != other.blocks:
        return [~one.reserved, ~other.reserved]
    return [~one.reserved & ~other.reserved] * 2


def doubted(
    fitter: Fitter, base: Fitted, other: Fitter, blocks: Sequence[np.ndarray], ends: float, model: Fitted
) -> bool:
    """Tell whether a model (beside the baseline `base`) does worse than its effects by the other way.

    `blocks` are those on which either way is measured; the `other` is left as it is. By what law friction
    yields is the axis's own, whichever way its command is taken.
    """
    own, first = (Left.by(fitter, one, blocks[0]) for one in (model, base))
    there = other.on(other.balance.data)
    there.offset, there.balance.exponent = fitter.offset, fitter.balance.exponent
    same, fewer = (least_left(there, some, blocks[1], ends) for some in (model.terms, model.terms[:-1]))
    return outdone(first, own, same, fewer)


def least_left(fitter: Fitter, terms: Sequence[Term], blocks: np.ndarray, ends: float) -> Left:
    """Return what effects leave, the last of them in the form that suits this way."""
    settle(fitter, terms, ends, law=False)
    same = fitter.fit(terms)
    forms = in_better_form(fitter, [same], ends) if terms else []
    models = [same, *(fitter.fit([*terms[:-1], form], same) for form in forms)]
    return min((Left.by(fitter, model, blocks) for model in models), key=lambda left: left.weighed)


def outdone(first: Left, own: Left, same: Left, fewer: Left) -> bool:
    """Tell whether a model does worse than the other way to take the command.

    It leaves `own` of what there was at `first`; the other way `same` with its effects, `fewer` without the
    last. Where this one does not matter against the other way without it, by either measure, it only makes
    up for the way.
    """

    def matters(of: str) -> bool:
        there, mine, without = (math.exp(0.5 * getattr(left, of)) for left in (first, own, fewer))
        return without - mine > LEAST_GAIN * there

    better = same.weighed < own.weighed and same.force < own.force
    return better or not (matters("weighed") and matters("force"))
