"""A model fitted to an objective, and what it makes of blocks left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting.free import AT_BOUND, Free, Term
from rtcomp.diagnosis.numerics.regression import Grams, Prior, System
from rtcomp.kernels import Floats

ONCE = 0.5
"""A column with more than this part of its power in one block: the other blocks do not show its size."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """A model fitted on the blocks that are not reserved."""

    terms: tuple[Term, ...]
    coefficients: Floats
    """(p,): base, then sizes of entries that add a force, in the units of the columns."""
    system: System
    grams: Grams
    """Statistics of its columns."""
    prior: Prior
    residual: Floats
    """(n,), whitened, all rows."""
    tangents: Floats
    """(q, n): change of the model with each free nonlinear parameter (on its scale)."""
    free: tuple[Free, ...]
    errors: Floats
    """(B_use,): squared error of each block left out."""
    without: Floats
    """(B_use, p + q): coefficients and nonlinear changes without each block."""
    sse: float
    """Squared error of all blocks that are not reserved, in sample."""
    variance: float
    weights: Floats
    """N/m of the friction units."""
    reaches: Floats
    """Their yield displacements (m)."""
    off: Floats | None = None
    """(p + q,): by how much the numbers of its replicates are off on average; None where there are none."""

    @property
    def level(self) -> float:
        """Return the force (N) that all its friction units hold together."""
        return float(self.weights @ self.reaches)

    @property
    def whole(self) -> Floats:
        """Its coefficients, and no change of its nonlinear parameters, (p + q,)."""
        return np.append(self.coefficients, np.zeros(len(self.free)))

    @property
    def size(self) -> int:
        """Number of parameters of its effects."""
        return sum(len(t.free) for t in self.terms)

    @property
    def at_bound(self) -> bool:
        """Tell whether a nonlinear parameter of the last term, or the mass, came out at its bound.

        Earlier terms do not count: their values may compensate for an effect that is not found yet.
        """
        last = len(self.terms) - 1
        return self.weightless or any(f.at_bound(self.terms) for f in self.free if f.term == last)

    @property
    def weightless(self) -> bool:
        """Tell whether the mass came out as small as it may be: a motion that needs no force is no axis's.

        What drives it nowhere and what holds it, as strong as the drive, leave nothing open between them.
        """
        return bool(self.coefficients[0] <= (1.0 + AT_BOUND) * self.prior.low[0])

    @property
    def free_columns(self) -> Floats:
        """Columns (p, n) that are not at a bound, with the tangents."""
        slack = 1e-9 * np.abs(self.coefficients)
        free = self.coefficients > self.prior.low + slack
        free &= self.coefficients < self.prior.high - slack
        return np.concatenate([self.system.columns[free], self.tangents])

    @property
    def entries(self) -> list[Entry]:
        """Return the entries with the values found."""
        return [t.entry for t in self.terms]


def left_out(
    grams: Grams, use: np.ndarray, prior: Prior, variance: float, whole: Floats, numbers: int = 0
) -> tuple[Floats, Floats]:
    """Return squared errors (B_use,) of blocks predicted by the others, and coefficients without each.

    What happens in one block only keeps the size that it has in the `whole` fit there: other blocks cannot
    tell it. Not so the first coefficients, so many `numbers` of the stage.
    """
    members = np.flatnonzero(use)
    power = np.einsum("kii->ki", grams.gram[use])
    alone = power > ONCE * np.maximum(power.sum(axis=0), 1e-300)
    alone[:, :numbers] = False
    errors, found = np.empty(members.size), []
    for i, k in enumerate(members):
        others = use.copy()
        others[k] = False
        held = prior
        if alone[i].any():
            low, high = prior.low.copy(), prior.high.copy()
            low[alone[i]] = high[alone[i]] = whole[alone[i]]
            held = Prior(prior.mean, prior.precision, low, high)
        c = grams.solve(others, held, variance)
        errors[i] = grams.errors(c, np.array([k]))[0]
        found.append(c)
    return errors, np.array(found)
