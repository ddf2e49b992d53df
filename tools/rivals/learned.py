"""The program's own operators behind the rivals' interface: learned sample by sample, in one pass.

`ridge` becomes the learner's trust, which is the same prior: ridge a sample, on weights of unit amplitude.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from rivals import Motion, amplitude
from rtcomp.hysteresis.basis import Basis
from rtcomp.hysteresis.gradient import Gradient
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.learner import Learner
from rtcomp.hysteresis.rls import Rls
from rtcomp.hysteresis.shaped import ShapedIntervalBasis
from rtcomp.jobs.shape.choice import learned, with_offset
from rtcomp.kernels import Floats

Make = Callable[[float], Basis]
"""Builds the basis for a largest input."""


class Learned:
    """A basis and RLS, or the projected gradient (`passes` times over, for it is slow).

    Where `trust` is given it stays, whatever the ridge.
    """

    def __init__(
        self,
        name: str,
        make: Make,
        source: str = "",
        *,
        gradient: bool = False,
        passes: int = 1,
        trust: float | None = None,
    ) -> None:
        self.name, self.make, self.gradient, self.passes, self.trust = name, make, gradient, passes, trust
        self.basis: Basis = IntervalBasis([1.0])
        self.source = source or self.basis.source
        self.weights = np.zeros(2)
        self.learner: Learner = Rls()

    def _columns(self, u: Floats, before: Floats) -> Floats:
        return with_offset(self.basis, np.concatenate([[0.0], before, u]))[1 + before.size :]

    def _learn(self, motions: Sequence[Motion]) -> None:
        x = np.concatenate([self._columns(m.u, m.before) for m in motions] * self.passes)
        y = np.concatenate([m.y for m in motions] * self.passes)
        self.weights = learned(self.basis, self.learner, x, y, np.arange(y.size))

    def fit(self, motions: Sequence[Motion], ridge: float) -> None:
        """Learn one motion after the other; the shape of a bent output is taken from the weights, twice."""
        rows = sum(m.y.size for m in motions)
        trust = self.trust or float(np.clip((ridge * rows) ** -0.5, 1e-3, 1e6))
        self.learner = Gradient() if self.gradient else Rls(1.0, trust)
        self.basis = self.make(amplitude(motions))
        self._learn(motions)
        for _ in range(2):
            b = self.basis
            if not isinstance(b, ShapedIntervalBasis) or not b.takes_shape:
                break
            slopes = self.weights[: b.widths.size]
            if float(slopes @ b.widths) > 0.0:
                self.basis = b.changed(shape=slopes)
                self._learn(motions)

    def predict(self, u: Floats, before: Floats) -> Floats:
        """Return the output along `u`."""
        return np.asarray(self._columns(u, before) @ self.weights)

    def numbers(self) -> int:
        """Return the numbers kept."""
        return self.basis.vector().size + self.basis.initial_state().size + 2 * self.weights.size
