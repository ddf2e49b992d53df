"""The belief as it is, not refitted, against recordings of its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.replicate import left_by
from rtcomp.diagnosis.numerics.significance import Null
from rtcomp.diagnosis.recordings.data import Data
from rtcomp.diagnosis.settings import BELIEF_SD, LEVEL, TOLERANCE
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

FEW = 6
"""Replicates of a belief."""


def null_of_belief(
    balance: ForceBalance,
    stage: Stage,
    left: Callable[[Data], Floats],
    seed: int,
    gains: Floats | None = None,
) -> Null | None:
    """Return what is `left` of recordings of a believed `stage`, as it is; None where it makes too few.

    `gains` are those of another null distribution, which go on to count.
    """

    def one(number: int) -> Floats | None:
        data = left_by(stage, balance, 1000 * seed + number)
        return None if data is None else left(data)

    errors = [e for e in shared(one, range(FEW)) if e is not None]
    if len(errors) < FEW // 2:
        return None
    return Null(np.zeros(len(errors)) if gains is None else gains, np.array(errors))


def no_more_than_its_own(fitter: Fitter, believed: Stage, seed: int) -> bool:
    """Tell whether a belief leaves little of the force, or no more than of recordings of its own."""
    unfitted = _left_as_it_is(fitter, believed)
    if unfitted.sum() <= TOLERANCE**2 * np.count_nonzero(fitter.rows):
        return True
    own = _of_unfitted(fitter, believed, seed)
    return own is not None and own.p_of_error(unfitted) >= LEVEL


def as_loud(fitter: Fitter, believed: Stage, chosen: Fitted, null: Null | None, seed: int) -> Null | None:
    """Return what fits of the belief leave of its own recordings, where that is as much; else None.

    Asked where a search found nothing. What rings or chatters beyond the bandwidth looks like damping to a
    fit: a fitted stage that has it rings less, and what its replicates leave is no measure. The
    unfitted belief must also agree with the recording, or have no larger error than on its own replicates.
    """
    if chosen.terms or null is None or not no_more_than_its_own(fitter, believed, seed):
        return None
    balance, gains = fitter.balance, null.gains
    own = null_of_belief(balance, believed, lambda data: fitter.on(data).fit([]).errors, seed, gains)
    return own if own is not None and own.as_loud(chosen.errors, LEVEL) else None


def agrees(fitter: Fitter, believed: Stage, seed: int) -> bool:
    """Tell whether the belief leaves no more, beyond its replicates, than its numbers may be off by.

    Asked where nothing was found and no number moved. An objective that trusts no row finds nothing, whatever
    is missing; numbers that it cannot tell may still be off as far as they are believed (BELIEF_SD).
    """
    unfitted = float(_left_as_it_is(fitter, believed).sum())
    enough = BELIEF_SD**2 * np.count_nonzero(fitter.rows)
    if unfitted <= enough:
        return True
    own = _of_unfitted(fitter, believed, seed)
    return bool(own is not None and unfitted - own.noise <= enough)


def _of_unfitted(fitter: Fitter, believed: Stage, seed: int) -> Null | None:
    """Return what a belief leaves of recordings of its own."""
    return null_of_belief(
        fitter.balance, believed, lambda data: _left_as_it_is(fitter.on(data), believed), seed
    )


def _left_as_it_is(fitter: Fitter, believed: Stage) -> Floats:
    """Return the squared relative force error of a belief in each block to fit, (B_use,)."""
    return np.asarray(np.bincount(fitter.block, fitter.left_by(believed) ** 2, fitter.blocks)[fitter.use])
