"""What lies beyond the reach: how the virgin curve goes on where the motion learned from did not go.

Weight 0 there says that everything slides, which no data said. Friction's virgin curve falls off towards its
level about exponentially (Dahl's model is exactly that), so the weights that are known say how those behind
them go on:

    w_i = w_k exp(-(x_i - x_k) / d),    k the last that is known, x the middle of an interval in travel (m)

with 1 / d the mean fall of the logarithm of the known weights, at least 0. Known is what the motion passed
through several times: an interval that only a drift of the centre touched has been seen once, mostly at
turning points, where creep hides the slope.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rtcomp.kernels import Floats

LEAST_PASSES = 3.0
"""Times that motion must have filled and emptied an interval for its weight to count as known."""


def passes(activations: Floats, widths: Floats) -> Floats:
    """Return how often each interval was filled and emptied, (N,), from activations (K, N) along a motion."""
    return np.asarray(np.abs(np.diff(activations, axis=0)).sum(axis=0) / (2.0 * widths))


def continued(
    weights: Floats, widths: Floats, passed: Floats, least: float = LEAST_PASSES
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return weights (N,) that go on beyond the reach, and which of them (N,) did not come from data.

    widths: (N,) m. passed: (N,), what `passes` returns. Only intervals behind the last one known change; with
    none known, or the last one not above 0, nothing does. Not a learner's business: weights are as found.
    """
    weights = np.array(weights, dtype=np.float64)
    known = np.flatnonzero(passed >= least)
    guessed = np.zeros(weights.size, dtype=np.bool_)
    if known.size == 0 or weights[known[-1]] <= 0.0:
        return weights, guessed
    last = int(known[-1])
    middle = np.cumsum(widths) / 2 - widths / 4
    rising = known[weights[known] > 0.0]
    rate = 0.0
    if rising.size > 1:
        rate = max(-float(np.polyfit(middle[rising], np.log(weights[rising]), 1)[0]), 0.0)
    guessed[last + 1 :] = True
    weights[guessed] = weights[last] * np.exp(-rate * (middle[guessed] - middle[last]))
    return weights, guessed
