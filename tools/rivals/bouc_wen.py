"""The Bouc-Wen model, fitted by least squares: one state, bent by the direction of motion.

    dh = du (1 - (b sgn(h du) + g) |h|^n),   y = c + k u + a h      (u over the largest input)

Bouc (1967); Wen (1976), "Method for random vibration of hysteretic systems", J. Eng. Mech. 102(2).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from rivals import Motion, amplitude, solve
from rtcomp.kernels import Floats, compiled

STARTS = ((1.0, 0.0, 1.0), (3.0, 0.5, 1.0), (3.0, -1.0, 1.5), (8.0, 0.0, 1.0))
_STEP = 0.01


@compiled
def state(v: Floats, b: float, g: float, n: float, out: Floats) -> None:
    """Run the state from rest over the normalised input `v` (K,), in steps of at most 0.01 of it."""
    h = 0.0
    last = v[0]
    for k in range(v.size):
        way = v[k] - last
        last = v[k]
        steps = int(abs(way) / _STEP) + 1
        for _ in range(steps):
            sign = b if h * way > 0.0 else -b
            h += way / steps * (1.0 - (sign + g) * abs(h) ** n)
            h = min(max(h, -1e3), 1e3)
        out[k] = h


class BoucWen:
    """Six parameters."""

    name = "Bouc-Wen"
    source = "Bouc (1967); Wen (1976), J. Eng. Mech. 102(2)"

    def __init__(self) -> None:
        self.shape, self.weights, self.scale = np.zeros(3), np.zeros(3), 1.0

    def _columns(self, shape: Floats, u: Floats, before: Floats) -> Floats:
        v = np.concatenate([[0.0], before, u]) / self.scale
        out = np.empty_like(v)
        state(v, float(shape[0]), float(shape[1]), float(shape[2]), out)
        return np.column_stack([out, v, np.ones_like(v)])[1 + before.size :]

    def fit(self, motions: Sequence[Motion], ridge: float) -> None:
        """Find the parameters by least squares."""
        self.scale = amplitude(motions)
        y = np.concatenate([m.y for m in motions])

        def columns(shape: Floats) -> Floats:
            return np.concatenate([self._columns(shape, m.u, m.before) for m in motions])

        def residual(shape: Floats) -> Floats:
            x = columns(shape)
            return np.asarray(x @ solve(x, y, ridge) - y)

        bounds = (np.array([0.0, -20.0, 0.3]), np.array([50.0, 20.0, 4.0]))
        fits = [least_squares(residual, np.array(s), bounds=bounds, max_nfev=80) for s in STARTS]
        self.shape = min(fits, key=lambda f: float(f.cost)).x
        self.weights = solve(columns(self.shape), y, ridge)

    def predict(self, u: Floats, before: Floats) -> Floats:
        """Return the output along `u`."""
        return np.asarray(self._columns(self.shape, u, before) @ self.weights)

    def numbers(self) -> int:
        """Return the numbers kept."""
        return 2 + self.shape.size + self.weights.size
