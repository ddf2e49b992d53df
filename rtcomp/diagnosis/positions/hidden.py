"""Whether friction hides so much of a motion that a balance of forces is no judge, and positions must be."""

from __future__ import annotations

from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.replicated import replicated
from rtcomp.diagnosis.forces.sticking import untold

MUCH = 0.03
"""Part of the drive's force (rms). A balance of forces that leaves more than noise is no judge where friction
may make more than this of it unseen, and where it leaves more than this open on a replicate of its own fit.
Of 33 geared joints with a 12-bit encoder it left 0.005 to 0.037, of one with a play 0.23, of two pendulums
whose friction yields within a count 0.036 and 0.045, of a measured servo 0.38."""


def hides(fitter: Fitter, model: Fitted) -> bool:
    """Tell whether friction hides so much that a balance of forces, here of a `model`, is no judge.

    It would be one if it told how a replicate of that model came about.
    """
    balance = fitter.balance
    if untold(balance) <= MUCH:
        return False
    data = replicated(fitter, model)
    if data is None:
        return True
    other = fitter.on(data)
    return other.relative(other.fit(model.terms, model)) > MUCH
