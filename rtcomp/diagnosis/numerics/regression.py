"""Bounded least squares over blocks with a prior: fitted on some blocks, validated on the others."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.numerics.bounded import bounded_minimum
from rtcomp.kernels import Floats

RIDGE = 1e-9
"""Part of the columns' mean power that is added to each: columns alike share what they explain."""
FREEDOM = 4.0
"""Degrees of freedom of what is believed (Student's t) of a number that is larger: near the belief as Gauss
has it, and a guess of a hundredth costs little more than one that is off by a few of its deviations. What is
smaller is off by all of it at most, and as Gauss has it."""
RELAXED, SETTLED = 20, 1e-3
"""Solutions with precisions of the one before, at most; relative change at which they are settled."""


@dataclass(frozen=True)
class System:
    """``y = A c`` in whitened units: y (n,), columns (p, n); numbers of entries' columns by entry."""

    y: Floats
    columns: Floats
    of_entry: tuple[slice, ...]


@dataclass(frozen=True)
class Prior:
    """What is believed of the coefficients: mean and precision (p,); precision 0 is no belief. And bounds."""

    mean: Floats
    precision: Floats
    low: Floats
    high: Floats

    def relaxed(self, c: Floats) -> Prior:
        """Return the prior of Gauss that pulls coefficients `c` as Student's t does (Lange et al. 1989)."""
        larger = (c - self.mean) * np.where(self.mean < 0.0, -1.0, 1.0) > 0.0
        off = np.where(larger, self.precision * (c - self.mean) ** 2, 0.0)
        return Prior(self.mean, self.precision * FREEDOM / (FREEDOM + off), self.low, self.high)

    def extended(self, count: int) -> Prior:
        """Return the prior with so many further coefficients, of which nothing is known."""
        own, more = (self.mean, self.precision, self.low, self.high), (0.0, 0.0, -np.inf, np.inf)
        return Prior(*(np.append(one, np.full(count, each)) for one, each in zip(own, more, strict=True)))


@dataclass(frozen=True)
class Grams:
    """Sufficient statistics of ``y = A c`` by block."""

    gram: Floats
    """(B, p, p)."""
    cross: Floats
    """(B, p)."""
    power: Floats
    """(B,)."""
    rows: Floats
    """(B,)."""

    @classmethod
    def of(cls, columns: Floats, y: Floats, block: np.ndarray, count: int) -> Grams:
        """Gather from columns (p, n), y (n,) and the sorted block number of every row (n,)."""
        edges = np.searchsorted(block, np.arange(count + 1))

        def products(ends: tuple[int, int]) -> tuple[Floats, Floats, float]:
            part, target = columns[:, slice(*ends)], y[slice(*ends)]
            return part @ part.T, part @ target, float(target @ target)

        work = 2.0 * columns.shape[0] * columns.size
        made = shared(products, pairwise(edges.tolist()), operations=work)
        gram, cross, power = zip(*made, strict=True)
        return cls(np.array(gram), np.array(cross), np.array(power), np.diff(edges).astype(np.float64))

    def extended(self, columns: Floats, more: Floats, y: Floats, block: np.ndarray) -> Grams:
        """Return those of their columns (p, n) and `more`, (q, n), together; only what is new is computed."""
        edges = np.searchsorted(block, np.arange(self.power.size + 1))

        def products(ends: tuple[int, int]) -> tuple[Floats, Floats, Floats]:
            part = more[:, slice(*ends)]
            return part @ columns[:, slice(*ends)].T, part @ part.T, part @ y[slice(*ends)]

        work = 2.0 * more.shape[0] * (columns.size + more.size)
        made = shared(products, pairwise(edges.tolist()), operations=work)
        between, own, cross = (np.array(each) for each in zip(*made, strict=True))
        gram = np.concatenate([self.gram, between], axis=1)
        gram = np.concatenate([gram, np.concatenate([between.transpose(0, 2, 1), own], axis=1)], axis=2)
        return Grams(gram, np.concatenate([self.cross, cross], axis=1), self.power, self.rows)

    def solve(self, use: np.ndarray, prior: Prior, variance: float) -> Floats:
        """Return the coefficients (p,) fitted on the blocks where `use` (B,) is true.

        `variance` of a row's residual weighs the prior against the rows.
        """
        gram, cross = self.gram[use].sum(axis=0), self.cross[use].sum(axis=0)
        scale = np.sqrt(np.diag(gram))
        scale = np.where(scale > 0.0, scale, 1.0)
        weight = prior.precision * variance
        a = (gram + np.diag(weight)) / np.outer(scale, scale)
        a += RIDGE * np.eye(scale.size)
        b = (cross + weight * prior.mean) / scale
        return np.asarray(bounded_minimum(a, b, prior.low * scale, prior.high * scale)) / scale

    def solved(self, use: np.ndarray, prior: Prior, variance: float) -> tuple[Prior, Floats]:
        """Return coefficients as `solve`, and the prior they have: as it is."""
        return prior, self.solve(use, prior, variance)

    def relaxed(self, use: np.ndarray, prior: Prior, variance: float) -> tuple[Prior, Floats]:
        """Return coefficients as `solve`, where what is believed may be far off, and the prior they have."""
        c = self.solve(use, prior, variance)
        at = prior.relaxed(c)
        last = prior
        for _ in range(RELAXED):
            if np.all(np.abs(at.precision - last.precision) <= SETTLED * last.precision):
                break
            last = at
            c = self.solve(use, last, variance)
            at = prior.relaxed(c)
        return at, c

    def errors(self, c: Floats, which: np.ndarray) -> Floats:
        """Return the squared error of coefficients in each block of `which`."""
        g, h = self.gram[which], self.cross[which]
        found = self.power[which] - 2.0 * h @ c + np.einsum("i,kij,j->k", c, g, c)
        return np.asarray(np.maximum(found, 1e-12 * self.power[which] + 1e-300))
