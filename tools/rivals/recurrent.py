"""A small recurrent network, trained off line: an echo state network whose time is the way of the input.

    dh_i / |dv| = k_i (tanh(sum_j W_ij h_j + a_i sgn dv + c_i v + b_i) - h_i),   y = o . (h, v, 1)

Jaeger (2001), "The echo state approach to analysing and training recurrent neural networks", GMD report 148.
Its weights inside are drawn and stay; the readout is fitted by least squares, and of `DRAWS` draws the one
that fits the training motions best is taken. With time for its clock it would be no static hysteresis.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rivals import Motion, amplitude, solve
from rtcomp.kernels import Floats, compiled

DRAWS = 12
RADIUS = 0.8
"""Spectral radius of the weights inside: below 1, so that what was long ago is forgotten."""
_STEP = 0.02


@compiled
def echoes(
    v: Floats, inside: Floats, sign: Floats, slope: Floats, bias: Floats, rate: Floats, out: Floats
) -> None:
    """Run the units from rest over the normalised input `v` (K,), in steps of at most 0.02, into `out`."""
    n = sign.size
    h, new = np.zeros(n), np.zeros(n)
    last = v[0]
    for k in range(v.size):
        way = v[k] - last
        steps = int(abs(way) / _STEP) + 1
        direction = 1.0 if way > 0.0 else -1.0
        for step in range(steps if way != 0.0 else 0):
            at = last + way * (step + 1) / steps
            for i in range(n):
                total = bias[i] + sign[i] * direction + slope[i] * at
                for j in range(n):
                    total += inside[i, j] * h[j]
                new[i] = h[i] + (1.0 - np.exp(-rate[i] * abs(way) / steps)) * (np.tanh(total) - h[i])
            h[:] = new
        last = v[k]
        out[k] = h


class Recurrent:
    """`count` units."""

    name = "recurrent network"
    source = "Jaeger (2001), GMD report 148"

    def __init__(self, count: int = 30) -> None:
        self.count = count
        self.draw, self.weights, self.scale = 0, np.zeros(0), 1.0

    def _columns(self, draw: int, u: Floats, before: Floats) -> Floats:
        rng, n = np.random.default_rng(draw), self.count
        inside = rng.standard_normal((n, n))
        inside *= RADIUS / np.abs(np.linalg.eigvals(inside)).max()
        sign, slope, bias = rng.uniform(-1.0, 1.0, n), rng.uniform(-2.0, 2.0, n), rng.uniform(-1.0, 1.0, n)
        v = np.concatenate([before, u]) / self.scale
        out = np.empty((v.size, n))
        echoes(v, inside, sign, slope, bias, 10 ** rng.uniform(-0.5, 1.5, n), out)
        return np.column_stack([out, v, np.ones_like(v)])[before.size :]

    def fit(self, motions: Sequence[Motion], ridge: float) -> None:
        """Find the readout by least squares."""
        self.scale = amplitude(motions)
        y = np.concatenate([m.y for m in motions])
        least = np.inf
        for draw in range(DRAWS):
            x = np.concatenate([self._columns(draw, m.u, m.before) for m in motions])
            weights = solve(x, y, ridge)
            off = float(np.mean((x @ weights - y) ** 2))
            if off < least:
                least, self.draw, self.weights = off, draw, weights

    def predict(self, u: Floats, before: Floats) -> Floats:
        """Return the output along `u`."""
        return np.asarray(self._columns(self.draw, u, before) @ self.weights)

    def numbers(self) -> int:
        """Return the numbers kept."""
        return self.count**2 + 5 * self.count + self.weights.size
