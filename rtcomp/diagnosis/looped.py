"""Whether an effect acts in a simulated loop of its model as it does along the recording.

In closed loop the command makes up for whatever there is. A model that takes part of the command away, as a
drive at its limit, needs no other force then: it fits, though in a loop of its own it would not ask for so
much there.
"""

from __future__ import annotations

import numpy as np

from rtcomp.diagnosis.confirmed import LEAST
from rtcomp.diagnosis.data import Data
from rtcomp.diagnosis.fit import Fitter
from rtcomp.diagnosis.fitted import Fitted
from rtcomp.diagnosis.other_forms import force_of
from rtcomp.diagnosis.replicate import replicate
from rtcomp.diagnosis.significance import SURE
from rtcomp.kernels import Floats


def acts_otherwise(fitter: Fitter, model: Fitted, at: int) -> bool:
    """Tell whether effect number `at` of a model plainly acts otherwise in its loop than in the recording.

    Never where the recording has no reference, or the stage no controller: the recorded command acts then.
    Nor where its loop loses the recorded motion.
    """
    balance = fitter.balance
    if balance.stage.controller is None or any(s.reference is None for s in balance.data.segments):
        return False
    made = [data for data in (_replicate(fitter, model, seed) for seed in (0, 1)) if data is not None]
    if len(made) < 2:
        return False  # a loop that is hardly stable: numbers a little off lose it
    forces = [force_of(fitter, model, at)]
    for data in made:
        other = fitter.on(data)
        forces.append(force_of(other, other.fit(list(model.terms), model, steps=0), at))
    blocks = [balance.block == block for block in np.flatnonzero(~balance.reserved)]
    part, error = alike(np.array([[[f[own] @ g[own] for g in forces] for f in forces] for own in blocks]))
    return part + SURE * error < LEAST


def alike(products: Floats) -> tuple[float, float]:
    """Return what part of a recorded force two simulations repeat, and its standard error over blocks.

    By the products of all three, (B, 3, 3), the recorded first, summed up over each block: what the simulated
    have in common is what noise does not change of them. 1 where all is repeated but for noise. The error is
    that of blocks left out in turn (jackknife).
    """

    def part(some: np.ndarray) -> float:
        p = products[some].sum(axis=0)
        noise = max(0.5 * (p[1, 1] + p[2, 2]) - p[1, 2], 0.0)
        return float(0.5 * (p[0, 1] + p[0, 2]) / max(p[0, 0] - noise, p[1, 2], 1e-300))

    count = products.shape[0]
    without = np.array([part(np.arange(count) != k) for k in range(count)])
    error = float(np.sqrt((count - 1) / count * np.sum((without - without.mean()) ** 2)))
    return part(np.ones(count, dtype=np.bool_)), error


def _replicate(fitter: Fitter, model: Fitted, seed: int) -> Data | None:
    balance = fitter.balance
    stage = fitter.stage(model, between=True)
    return replicate(stage, balance.data, [p.x for p in balance.paths()], balance.read_noise(stage), seed)
