"""The model whose recordings are fitted as the real one is: what a biased fit says of the truth.

Where a sensor is coarse, a fit is bent: friction within a count goes along with the drive and looks like a
mass that is less. Replicates of such a fit are bent further, and are not as loud as the recording, for noise
of a reading is a force by the mass. The numbers of the replicated model are moved until fits of its
replicates find those of the recording (indirect inference: Gourieroux, Monfort, Renault 1993, Journal of
Applied Econometrics 8).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.unbiased import numbers_of
from rtcomp.diagnosis.forces.replicate import left_by
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats

ROUNDS, EACH = 4, 3
"""Times that the numbers are moved; replicates each time."""


def matched(
    fitter: Fitter, fitted: Fitted, seed: int, ends: float = math.inf
) -> Iterator[tuple[Fitted, Floats]]:
    """Go through models that would be fitted as `fitted` is, each with what its numbers are more, (p + q,).

    First with friction of the fit's shape, then of the believed one: within a count a fit does not tell it.
    None is begun, and none goes on, after the time `ends` (clock.now).
    """
    own = fitter.balance.friction
    for weights in (fitted.weights, fitter.balance.weights):
        if not weights.any():
            continue
        coefficients = fitted.coefficients.copy()
        coefficients[own] = weights
        true, more = replace(fitted, coefficients=coefficients, weights=weights), np.zeros(fitted.whole.size)
        more[own] = weights - fitted.weights
        try:
            for i in range(ROUNDS):
                if clock.now() > ends:
                    return
                numbers = _refitted(fitter, fitted, true, seed + i * EACH)
                change = fitted.whole - numbers
                change[0] = true.coefficients[0] * (fitted.whole[0] / numbers[0] - 1.0)  # bent in proportion
                true, more = fitter.moved_by(true, change), more + change
        except ConfigError:
            continue
        yield true, more


def _refitted(fitter: Fitter, fitted: Fitted, true: Fitted, seed: int) -> Floats:
    """Return the mean numbers (p + q,) of fits of replicates of a `true` model; raise ConfigError without."""
    stage = fitter.stage(true, between=True)

    def one(number: int) -> Floats | None:
        data = left_by(stage, fitter.balance, number)
        if data is None:
            return None
        other = fitter.on(data)
        return numbers_of(other, other.fit(list(fitted.terms), fitted, steps=0))

    found = [n for n in shared(one, range(seed, seed + EACH)) if n is not None]
    if not found:
        raise ConfigError("the stage cannot be kept on the recorded motion")
    return np.asarray(np.mean(found, axis=0))
