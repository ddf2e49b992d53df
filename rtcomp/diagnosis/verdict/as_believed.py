"""The belief as it is, not refitted, against recordings of its own."""

from __future__ import annotations

import numpy as np

from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.numerics.significance import Null
from rtcomp.diagnosis.search.replicates import null_of_belief
from rtcomp.diagnosis.search.selection import Search
from rtcomp.diagnosis.settings import BELIEF_SD, LEVEL, TOLERANCE
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage


def as_loud(fitter: Fitter, believed: Stage, found: Search, seed: int) -> Null | None:
    """Return what fits of the belief leave of its own recordings, where that is as much; else None.

    Asked where a search found nothing. What rings or chatters beyond the bandwidth looks like damping to a
    fit: a fitted stage that has it rings less, and what its replicates leave is no measure. The
    unfitted belief must also agree with the recording, or have no larger error than on its own replicates.
    """
    if found.chosen.terms or found.null is None:
        return None
    gains, balance, unfitted = found.null.gains, fitter.balance, _left(fitter, believed)
    if unfitted.sum() > TOLERANCE**2 * np.count_nonzero(fitter.rows):
        null = null_of_belief(balance, believed, lambda data: _left(fitter.on(data), believed), seed)
        if null is None or null.p_of_error(unfitted) < LEVEL:
            return None
    null = null_of_belief(balance, believed, lambda data: fitter.on(data).fit([]).errors, seed, gains)
    return null if null is not None and null.as_loud(found.chosen.errors, LEVEL) else None


def agrees(fitter: Fitter, believed: Stage, seed: int) -> bool:
    """Tell whether the belief leaves no more, beyond its replicates, than its numbers may be off by.

    Asked where nothing was found and no number moved. An objective that trusts no row finds nothing, whatever
    is missing; numbers that it cannot tell may still be off as far as they are believed (BELIEF_SD).
    """
    unfitted, enough = float(_left(fitter, believed).sum()), BELIEF_SD**2 * np.count_nonzero(fitter.rows)
    if unfitted <= enough:
        return True
    own = null_of_belief(fitter.balance, believed, lambda data: _left(fitter.on(data), believed), seed)
    return bool(own is not None and unfitted - own.noise <= enough)


def _left(fitter: Fitter, believed: Stage) -> Floats:
    """Return the squared relative force error of the belief in each block to fit, (B_use,)."""
    return np.asarray(np.bincount(fitter.block, fitter.left_by(believed) ** 2, fitter.blocks)[fitter.use])
