"""Kuhnen's modified Prandtl-Ishlinskii model: stops, then one-sided dead zones without memory.

    y = c + sum_k s_k D_k(p),   p = w_0 u + sum_i w_i E_ri[u],
    D_k(p) = max(p - t_k, 0) for t_k > 0, min(p - t_k, 0) for t_k < 0, p for t_k = 0

Kuhnen (2003), "Modeling, identification and compensation of complex hysteretic nonlinearities", European J.
Control 9(4). His constraints, which keep the model invertible, are left out, which can only help it fit.
Play and stop are u in turn (play = u - stop), so w_0 makes this his play form as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from rivals import Motion, amplitude, solve
from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.stop import StopBasis
from rtcomp.kernels import Floats


class ModifiedPi:
    """`stops` stop operators and `zones` dead zones to each side."""

    name = "modified Prandtl-Ishlinskii"
    source = "Kuhnen (2003), European J. Control 9(4)"

    def __init__(self, stops: int = 20, zones: int = 4) -> None:
        self.stops, self.zones = stops, zones
        self.w, self.s, self.thresholds = np.zeros(0), np.zeros(0), np.zeros(0)
        self.scale = 1.0
        self.basis = StopBasis([1.0])

    def _bank(self, u: Floats, before: Floats) -> Floats:
        whole = np.concatenate([[0.0], before, u])
        return np.column_stack([regressors(self.basis, whole), whole])[1 + before.size :] / self.scale

    def _zones(self, p: Floats) -> Floats:
        columns = [np.ones_like(p), p]
        for t in self.thresholds:
            columns += [np.maximum(p - t, 0.0), np.minimum(p + t, 0.0)]
        return np.column_stack(columns)

    def fit(self, motions: Sequence[Motion], ridge: float) -> None:
        """Find the parameters by least squares."""
        self.scale = amplitude(motions)
        self.basis = StopBasis.over(self.stops, 2.0 * self.scale)
        bank = np.concatenate([self._bank(m.u, m.before) for m in motions])
        y = np.concatenate([m.y for m in motions])
        start = solve(np.column_stack([bank, np.ones(y.size)]), y, ridge)
        w = start[:-1] / np.abs(bank @ start[:-1]).max()
        self.thresholds = np.arange(1, self.zones + 1) / (self.zones + 1.0)
        n, rows = w.size, y.size
        weigh = np.sqrt(ridge * rows) * y.std()
        s = solve(self._zones(bank @ w), y, ridge)
        unit = float(np.abs(s).max())

        def residual(v: Floats) -> Floats:
            fitted = self._zones(bank @ v[:n]) @ (unit * v[n:])
            return np.concatenate([fitted - y, weigh * v[:n], weigh * v[n + 1 :]])

        def jacobian(v: Floats) -> Floats:
            p = bank @ v[:n]
            gain = np.full(rows, v[n + 1])
            for k, t in enumerate(self.thresholds):
                gain += v[n + 2 + 2 * k] * (p > t) + v[n + 3 + 2 * k] * (p < -t)
            by_data = np.column_stack([bank * (unit * gain)[:, None], unit * self._zones(p)])
            by_ridge = weigh * np.delete(np.eye(v.size), n, axis=0)
            return np.vstack([by_data, by_ridge])

        found = least_squares(residual, np.concatenate([w, s / unit]), jac=jacobian, max_nfev=200).x
        self.w, self.s = found[:n], unit * found[n:]

    def predict(self, u: Floats, before: Floats) -> Floats:
        """Return the output along `u`."""
        return np.asarray(self._zones(self._bank(u, before) @ self.w) @ self.s)

    def numbers(self) -> int:
        """Return the numbers kept."""
        return 2 * self.stops + self.w.size + self.s.size + self.thresholds.size
