"""A replicate of a fitted model: the recordings that it would have left."""

from __future__ import annotations

from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.forces.replicate import left_by
from rtcomp.diagnosis.recordings.data import Data
from rtcomp.errors import ConfigError


def replicated(fitter: Fitter, model: Fitted) -> Data | None:
    """Return a replicate of a model, its friction between the units of the grid.

    None where no stage has its numbers, or where the stage cannot be kept on the recorded motion.
    """
    try:
        stage = fitter.stage(model, between=True)
    except ConfigError:
        return None
    return left_by(stage, fitter.balance)
