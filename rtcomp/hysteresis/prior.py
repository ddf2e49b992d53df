"""What is known of friction before any data: its virgin curve rises, and ever less steeply.

Contacts yield one after the other, so the slope of the virgin curve, which is what the interval operator's
weights are, never grows with travel and never is negative. Noise in position breaks this first (it trades
neighbouring weights against each other), so putting it back removes noise and nothing else.
"""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats


def non_increasing(weights: Floats, information: Floats, free: int = 0) -> Floats:
    """Return the non-negative, non-increasing weights nearest to `weights` (N,).

    Nearest as the data see it: (v - w)' A (v - w) is smallest, with `information` A (N, N), the inverse of
    the estimate's covariance up to a factor. The last `free` weights (an offset) are not constrained. Weights
    that are so already come back as they are; others are found within about 1e-6 of the largest.
    """
    from scipy.optimize import lsq_linear

    n = weights.size - free
    if (np.diff(weights[:n], append=0.0) <= 0.0).all():
        return weights.copy()
    # Weights as sums of steps down, d >= 0, from the last to the first.
    steps = np.eye(weights.size)
    steps[:n, :n] = np.triu(np.ones((n, n)))
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    root = (np.sqrt(np.maximum(values, 1e-12))[:, None] * vectors.T) * scale
    columns = root @ steps
    norms = np.linalg.norm(columns, axis=0)
    low = np.where(np.arange(weights.size) < n, 0.0, -np.inf)
    with np.errstate(invalid="ignore"):  # a step of the solver that meets no bound is 0 times infinity to it
        found = lsq_linear(columns / norms, root @ weights, bounds=(low, np.inf), tol=1e-12)
    return np.asarray(steps @ (found.x / norms))
