"""Whether a recording tells two models apart: is the better fit more than recordings of the other show?

Errors that a sensor's counts make are not random: they favour the same model in every block. So recordings of
the other model are simulated, and both models are fitted to each (tests of separate families: Cox 1961,
Proc. 4th Berkeley Symposium 1; by simulation: Williams 1970, Biometrics 26(1)).
"""

from __future__ import annotations

import math

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.forces.replicate import left_by
from rtcomp.diagnosis.numerics.significance import log_gain
from rtcomp.diagnosis.search.replicates import FEW
from rtcomp.errors import ConfigError


def separate(fitter: Fitter, chosen: Fitted, other: Fitted, level: float, ends: float = math.inf) -> bool:
    """Tell whether the chosen model is better than another by more than on recordings of that, at `level`.

    True where such recordings cannot be made, or not before the time `ends`.
    """
    from scipy.special import stdtrit

    try:
        stage = fitter.stage(other, between=True)
    except ConfigError:
        return True

    def one(seed: int) -> float:
        data = None if clock.now() > ends else left_by(stage, fitter.balance, seed)
        if data is None:
            return math.nan
        again = fitter.on(data)
        try:
            fits = [again.fit(model.terms, model) for model in (other, chosen)]
        except (ConfigError, np.linalg.LinAlgError):
            return math.nan
        return log_gain(fits[0].errors, fits[1].errors)

    better = np.array(shared(one, range(FEW)))
    better = better[np.isfinite(better)]
    if better.size < 2:
        return True
    most = float(stdtrit(better.size - 1, 1.0 - level)) * math.sqrt(1.0 + 1.0 / better.size)
    return log_gain(other.errors, chosen.errors) > float(better.mean() + most * better.std(ddof=1))
