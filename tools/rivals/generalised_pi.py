"""Al Janaideh's generalised Prandtl-Ishlinskii model: play operators between envelopes for each direction.

    F_r <- max(l(u) - r, min(g(u) + r, F_r)),   y = c + sum_j p_j F_rj + p_0 u,
    l(u) = tanh(a1 u + a2) + a3,   g(u) = b0 tanh(b1 u + b2) + b3

Al Janaideh, Rakheja, Su (2011), "An analytical generalized Prandtl-Ishlinskii model inversion for hysteresis
compensation in micropositioning control", IEEE/ASME Trans. Mechatronics 16(4). There p_j is an exponential in
r_j; here each p_j is free, and u itself is added, which can only make it fit better (and lets force lead).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from rivals import Motion, amplitude, solve
from rtcomp.kernels import Floats, compiled

STARTS = ((1.0, 0.0), (0.4, 0.0), (2.0, 0.0), (1.0, 0.7), (1.0, -0.7))


@compiled
def plays(low: Floats, high: Floats, reaches: Floats, out: Floats) -> None:
    """Run the play operators between the envelopes (K,) from rest; write them to `out` (K, N)."""
    state = np.zeros(reaches.size)
    for k in range(low.size):
        for i in range(reaches.size):
            state[i] = max(low[k] - reaches[i], min(high[k] + reaches[i], state[i]))
            out[k, i] = state[i]


class GeneralisedPi:
    """`count` generalised play operators."""

    name = "generalised Prandtl-Ishlinskii"
    source = "Al Janaideh, Rakheja, Su (2011), IEEE/ASME Trans. Mechatronics 16(4)"

    def __init__(self, count: int = 20) -> None:
        self.count = count
        self.envelopes, self.weights, self.scale = np.zeros(7), np.zeros(0), 1.0

    def _columns(self, envelopes: Floats, u: Floats, before: Floats) -> Floats:
        a1, a2, a3, b0, b1, b2, b3 = envelopes
        v = np.concatenate([before, u]) / self.scale
        low, high = np.tanh(a1 * v + a2) + a3, b0 * np.tanh(b1 * v + b2) + b3
        out = np.empty((v.size, self.count))
        plays(low, high, np.arange(self.count) / self.count, out)
        return np.column_stack([out, v, np.ones_like(v)])[before.size :]

    def fit(self, motions: Sequence[Motion], ridge: float) -> None:
        """Find the parameters by least squares."""
        self.scale = amplitude(motions)
        y = np.concatenate([m.y for m in motions])

        def columns(envelopes: Floats) -> Floats:
            return np.concatenate([self._columns(envelopes, m.u, m.before) for m in motions])

        def residual(envelopes: Floats) -> Floats:
            x = columns(envelopes)
            return np.asarray(x @ solve(x, y, ridge) - y)

        low, high = np.array([0.05, -3, -2, 0.1, 0.05, -3, -2.0]), np.array([6, 3, 2, 4, 6, 3, 2.0])
        fits = []
        for slope, shift in STARTS:
            start = np.array([slope, -shift, 0.0, 1.0, slope, shift, 0.0])
            fits.append(least_squares(residual, start, bounds=(low, high), max_nfev=60))
        self.envelopes = min(fits, key=lambda f: float(f.cost)).x
        self.weights = solve(columns(self.envelopes), y, ridge)

    def predict(self, u: Floats, before: Floats) -> Floats:
        """Return the output along `u`."""
        return np.asarray(self._columns(self.envelopes, u, before) @ self.weights)

    def numbers(self) -> int:
        """Return the numbers kept."""
        return 2 * self.count + self.weights.size + self.envelopes.size
