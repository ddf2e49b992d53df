"""The belief as it is, where nothing was found: whether it leaves as much of recordings of its own."""

from __future__ import annotations

import numpy as np

from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.numerics.significance import Null
from rtcomp.diagnosis.search.as_it_is import left_as_it_is, no_more_than_its_own, null_of_belief, of_unfitted
from rtcomp.diagnosis.search.selection import Search
from rtcomp.diagnosis.settings import BELIEF_SD, LEVEL
from rtcomp.stage.stage import Stage


def as_loud(fitter: Fitter, believed: Stage, found: Search, seed: int) -> Null | None:
    """Return what fits of the belief leave of its own recordings, where that is as much; else None.

    Asked where a search found nothing. What rings or chatters beyond the bandwidth looks like damping to a
    fit: a fitted stage that has it rings less, and what its replicates leave is no measure. The
    unfitted belief must also agree with the recording, or have no larger error than on its own replicates.
    """
    if found.chosen.terms or found.null is None or not no_more_than_its_own(fitter, believed, seed):
        return None
    gains = found.null.gains
    null = null_of_belief(fitter.balance, believed, lambda data: fitter.on(data).fit([]).errors, seed, gains)
    return null if null is not None and null.as_loud(found.chosen.errors, LEVEL) else None


def agrees(fitter: Fitter, believed: Stage, seed: int) -> bool:
    """Tell whether the belief leaves no more, beyond its replicates, than its numbers may be off by.

    Asked where nothing was found and no number moved. An objective that trusts no row finds nothing, whatever
    is missing; numbers that it cannot tell may still be off as far as they are believed (BELIEF_SD).
    """
    unfitted = float(left_as_it_is(fitter, believed).sum())
    enough = BELIEF_SD**2 * np.count_nonzero(fitter.rows)
    if unfitted <= enough:
        return True
    own = of_unfitted(fitter, believed, seed)
    return bool(own is not None and unfitted - own.noise <= enough)
