"""Weights that vary smoothly: how alike neighbours are expected to be before anything is learned.

A weight of the operator with shape is a stiffness at a reach r, 0 to R / 2, and a place q, -R / 2 to R / 2;
one of `position` is the difference of two places, the middle one being in the interval's own weight, and one
of `reversible` that of a curve along q. Where stiffness is a Gaussian process with the correlation

    exp(-(dr^2 + dq^2) / (2 l^2))

over a length l, these follow, as sums of its values, and with them how much each tells of the others. A
learner that keeps a covariance begins with it: places that no motion came to are learned from those nearby,
and what rough weights could gain is left to what many samples say. Rasmussen and Williams (2006), Gaussian
Processes for Machine Learning, chapters 2 and 4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rtcomp.kernels import Floats

APART = 1e-6
"""Share of each variance in which a weight is on its own: so little, the covariance has an inverse."""

Term = tuple[float, float, float]
"""A value of the process in a weight: reach (m), place (m), factor."""


def correlation(processes: Sequence[Sequence[Sequence[Term]]], length: float) -> Floats:
    """Return the correlation (size, size) of weights, each a sum of values of a process.

    `processes`: of each process, which knows nothing of the others, its weights in their order, each a
    sequence of terms. `length`: l, m.
    """
    blocks = [_within(weights, length) for weights in processes]
    size = sum(len(b) for b in blocks)
    found = np.zeros((size, size))
    at = 0
    for block in blocks:
        found[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return found


def _within(weights: Sequence[Sequence[Term]], length: float) -> Floats:
    terms = np.array([t for weight in weights for t in weight]).reshape(-1, 3)
    owner: npt.NDArray[np.int64] = np.repeat(np.arange(len(weights)), [len(w) for w in weights])
    sums = np.zeros((len(weights), len(terms)))
    sums[owner, np.arange(len(terms))] = terms[:, 2]
    apart = terms[:, None, :2] - terms[None, :, :2]
    covariance = sums @ np.exp(-0.5 * (apart**2).sum(axis=2) / length**2) @ sums.T
    size = np.sqrt(np.diag(covariance))
    alike = covariance / np.outer(size, size)
    even = 0.5 * (alike + alike.T)  # to the last digit, as the covariance must be
    return np.asarray((1.0 - APART) * even + APART * np.eye(len(weights)))
