"""Linear least squares over blocks of a recording: fit on some, judge on others, at the cost of one.

All that is needed of each block is its Gram matrix, so that leaving a block out is a subtraction.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rtcomp.kernels import Floats


@dataclass(frozen=True)
class Blocks:
    """Sufficient statistics of ``y = A c`` in K blocks; columns scaled to unit norm over all of them."""

    gram: Floats
    """(K, p, p)."""
    cross: Floats
    """(K, p)."""
    power: Floats
    """(K,), sum of y^2."""
    scale: Floats
    """(p,), the norms that the columns were divided by."""

    @classmethod
    def of(cls, columns: Floats, y: Floats, block: np.ndarray, count: int) -> Blocks:
        """Gather from `columns` (n, p), `y` (n,), and the block number of every row (n,), sorted."""
        norms = np.linalg.norm(columns, axis=0)
        scale = np.where(norms > 0, norms, 1.0)
        a = columns / scale
        edges = np.searchsorted(block, np.arange(count + 1))
        gram, cross, power = [], [], []
        for first, last in pairwise(edges):
            part, target = a[first:last], y[first:last]
            gram.append(part.T @ part)
            cross.append(part.T @ target)
            power.append(target @ target)
        return cls(np.array(gram), np.array(cross), np.array(power), scale)

    def solve(self, use: np.ndarray, bounds: Bounds | None = None) -> Floats:
        """Return the scaled coefficients (p,) fitted on the blocks where `use` (K,) is true."""
        gram, cross = self.gram[use].sum(axis=0), self.cross[use].sum(axis=0)
        gram = gram + 1e-9 * np.trace(gram) / gram.shape[0] * np.eye(gram.shape[0])
        if bounds is None:
            return np.asarray(np.linalg.solve(gram, cross))
        return _bounded(gram, cross, bounds.low * self.scale, bounds.high * self.scale)

    def errors(self, scaled: Floats, which: np.ndarray) -> Floats:
        """Return the squared error of `scaled` coefficients in each block of `which`."""
        g, h = self.gram[which], self.cross[which]
        quadratic = np.einsum("i,kij,j->k", scaled, g, scaled)
        return np.asarray(np.maximum(self.power[which] - 2 * h @ scaled + quadratic, 0.0))

    def left_out(self, use: np.ndarray, bounds: Bounds | None = None) -> Floats:
        """Return the squared error in each block of `use`, predicted by the others of `use`; (K_use,)."""
        members = np.flatnonzero(use)
        found = np.empty(members.size)
        for i, k in enumerate(members):
            others = use.copy()
            others[k] = False
            found[i] = self.errors(self.solve(others, bounds), np.array([k]))[0]
        return found

    def coefficients(self, use: np.ndarray, bounds: Bounds | None = None) -> Floats:
        """Return the coefficients (p,) in the units of the columns, fitted on `use`."""
        return self.solve(use, bounds) / self.scale


@dataclass(frozen=True)
class Bounds:
    """Lowest and highest coefficient of every column, each (p,), in the units of the columns."""

    low: Floats
    high: Floats

    def with_free(self, count: int) -> Bounds:
        """Return the bounds with `count` more columns that may be anything."""
        free = np.full(count, np.inf)
        return Bounds(np.concatenate([self.low, -free]), np.concatenate([self.high, free]))


def _bounded(gram: Floats, cross: Floats, low: Floats, high: Floats) -> Floats:
    """Minimise c' G c / 2 - h' c within bounds by an active set (Portugal, Judice, Vicente 1994).

    The set changes as a whole at first and by single members when that would cycle.
    """
    size = cross.size
    state = np.zeros(size, dtype=np.int8)  # 0 free, -1 at low, 1 at high
    best, rounds = size + 1, 5
    tolerance = 1e-10 * float(np.abs(cross).max() + 1.0)
    c = np.zeros(size)
    for _ in range(20 * size):
        free = state == 0
        c = np.where(state < 0, low, np.where(state > 0, high, 0.0))
        if free.any():
            right = cross[free] - gram[np.ix_(free, ~free)] @ c[~free]
            c[free] = np.linalg.solve(gram[np.ix_(free, free)], right)
        slope = gram @ c - cross
        too_low, too_high = free & (c < low), free & (c > high)
        release = ((state < 0) & (slope < -tolerance)) | ((state > 0) & (slope > tolerance))
        wrong = too_low | too_high | release
        count = int(wrong.sum())
        if count == 0:
            return c
        if count < best:
            best, rounds = count, 5
        elif rounds > 0:
            rounds -= 1
        else:
            wrong = np.arange(size) == np.flatnonzero(wrong)[-1]
        state[wrong & too_low], state[wrong & too_high], state[wrong & release] = -1, 1, 0
    return np.clip(c, low, high)
