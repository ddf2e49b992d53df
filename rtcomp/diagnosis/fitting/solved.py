"""The linear part of a fit: the columns of a model with the prior of their coefficients, and its solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.numerics.regression import Grams, Prior, System
from rtcomp.kernels import Floats


@dataclass(frozen=True)
class Posed:
    """A system whose coefficients are to be found."""

    system: System
    grams: Grams
    """Statistics of its columns."""
    prior: Prior
    block: np.ndarray
    """Block of each row, (n,), sorted."""
    alone: bool
    """Whether it is the belief with nothing beside it, whose numbers may be far off."""

    def solved(self, use: np.ndarray, variance: float) -> Solved:
        """Return the solution on the blocks to `use`, (B,) bool, for residuals of this `variance`."""
        prior, c = (self.grams.relaxed if self.alone else self.grams.solved)(use, self.prior, variance)
        sse = float(self.grams.errors(c, use).sum())
        return Solved(self.system, self.grams, prior, self.block, self.alone, c, sse)

    def beside(self, more: Floats) -> tuple[Grams, Prior]:
        """Return statistics and prior of its columns and of `more`, (q, n), of which nothing is known."""
        columns, y = self.system.columns, self.system.y
        return self.grams.extended(columns, more, y, self.block), self.prior.extended(more.shape[0])


@dataclass(frozen=True)
class Solved(Posed):
    """A system with its coefficients."""

    c: Floats
    """(p,)."""
    sse: float
    """Squared error in sample."""

    @property
    def residual(self) -> Floats:
        """(n,)."""
        return np.asarray(self.system.y - self.c @ self.system.columns)
