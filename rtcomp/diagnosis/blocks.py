"""Linear least squares over blocks of a recording: fit on some, judge on others, at the cost of one.

All that is needed of each block is its Gram matrix, so that leaving a block out is a subtraction.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rtcomp.kernels import Floats, compiled


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
        edges = np.searchsorted(block, np.arange(count + 1))
        grams, crosses, power = [], [], []
        for first, last in pairwise(edges):
            part, target = columns[first:last], y[first:last]
            grams.append(part.T @ part)
            crosses.append(part.T @ target)
            power.append(target @ target)
        gram = np.array(grams)
        norms = np.sqrt(np.einsum("kii->i", gram))
        scale = np.where(norms > 0, norms, 1.0)
        return cls(gram / np.outer(scale, scale), np.array(crosses) / scale, np.array(power), scale)

    def extended(self, columns: Floats, more: Floats, y: Floats, block: np.ndarray) -> Blocks:
        """Return the statistics with further columns `more` (n, q) beside those (n, p) that these are of."""
        norms = np.linalg.norm(more, axis=0)
        scale = np.where(norms > 0, norms, 1.0)
        b = more / scale
        edges = np.searchsorted(block, np.arange(self.power.size + 1))
        grams, crosses = [], []
        for k, (first, last) in enumerate(pairwise(edges)):
            part = b[first:last]
            mixed = (columns[first:last].T @ part) / self.scale[:, None]
            grams.append(np.block([[self.gram[k], mixed], [mixed.T, part.T @ part]]))
            crosses.append(np.concatenate([self.cross[k], part.T @ y[first:last]]))
        return Blocks(np.array(grams), np.array(crosses), self.power, np.concatenate([self.scale, scale]))

    def solve(self, use: np.ndarray, bounds: Bounds | None = None) -> Floats:
        """Return the scaled coefficients (p,) fitted on the blocks where `use` (K,) is true."""
        gram, cross = self.gram[use].sum(axis=0), self.cross[use].sum(axis=0)
        gram = gram + 1e-9 * np.trace(gram) / gram.shape[0] * np.eye(gram.shape[0])
        if bounds is None:
            return np.asarray(np.linalg.solve(gram, cross))
        return bounded_minimum(gram, cross, bounds.low * self.scale, bounds.high * self.scale)

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

    def own_part(self, columns: Floats, which: int) -> Floats:
        """Return what no other of `columns` (n, p), those that these are of, has of column `which`; (n,)."""
        gram = self.gram.sum(axis=0)
        rest = np.arange(self.scale.size) != which
        inner = gram[np.ix_(rest, rest)] + 1e-9 * np.eye(self.scale.size - 1)
        part = np.linalg.solve(inner, gram[rest, which]) * self.scale[which] / self.scale[rest]
        return np.asarray(columns[:, which] - columns[:, rest] @ part)


@dataclass(frozen=True)
class Bounds:
    """Lowest and highest coefficient of every column, each (p,), in the units of the columns."""

    low: Floats
    high: Floats

    def within(self, coefficients: Floats) -> np.ndarray:
        """Tell of each of the coefficients (p,) whether it is not at a bound, (p,) bool."""
        slack = 1e-6 * np.abs(coefficients)
        return np.asarray((coefficients > self.low + slack) & (coefficients < self.high - slack))

    def with_free(self, count: int) -> Bounds:
        """Return the bounds with `count` more columns that may be anything."""
        free = np.full(count, np.inf)
        return Bounds(np.concatenate([self.low, -free]), np.concatenate([self.high, free]))


@compiled
def bounded_minimum(gram: Floats, cross: Floats, low: Floats, high: Floats) -> Floats:
    """Minimise c' G c / 2 - h' c within bounds by an active set (Portugal, Judice, Vicente 1994).

    The set changes as a whole at first and by single members when that would cycle.
    """
    size = cross.size
    state = np.zeros(size, dtype=np.int8)  # 0 free, -1 at low, 1 at high
    wrong = np.zeros(size, dtype=np.int8)
    best, rounds = size + 1, 5
    tolerance = 1e-10 * (np.abs(cross).max() + 1.0)
    c = np.zeros(size)
    for _ in range(20 * size):
        free = np.flatnonzero(state == 0)
        for i in range(size):
            if state[i] != 0:
                c[i] = low[i] if state[i] < 0 else high[i]
        if free.size > 0:
            part = np.empty((free.size, free.size))
            right = np.empty(free.size)
            for a in range(free.size):
                i = free[a]
                right[a] = cross[i]
                for j in range(size):
                    if state[j] != 0:
                        right[a] -= gram[i, j] * c[j]
                for b in range(free.size):
                    part[a, b] = gram[i, free[b]]
            c[free] = np.linalg.solve(part, right)
        slope = gram @ c - cross
        count = last = 0
        for i in range(size):
            wrong[i] = 0
            if state[i] == 0 and c[i] < low[i]:
                wrong[i] = -1
            elif state[i] == 0 and c[i] > high[i]:
                wrong[i] = 1
            elif (state[i] < 0 and slope[i] < -tolerance) or (state[i] > 0 and slope[i] > tolerance):
                wrong[i] = 2
            if wrong[i] != 0:
                count, last = count + 1, i
        if count == 0:
            return c
        single = False
        if count < best:
            best, rounds = count, 5
        elif rounds > 0:
            rounds -= 1
        else:
            single = True
        for i in range(size):
            if wrong[i] != 0 and (i == last or not single):
                state[i] = 0 if wrong[i] == 2 else wrong[i]
    return np.minimum(np.maximum(c, low), high)
