"""Recursive least squares with forgetting and a wind-up guard. O(N^2) a step."""

from __future__ import annotations

from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.learner import Learner, register_learner
from rtcomp.kernels import Floats, learner_kernel


@learner_kernel
def rls(p: Floats, s: Floats, x: Floats, w: Floats, error: float) -> None:
    """p: N, forgetting, cap of each variance in s (1/m^2, N entries). s: covariance (N x N), then N scratch.

    Forgetting inflates only variances below their cap, so directions that are not excited stop growing
    where they began: no wind-up at rest, in saturation or in part of the range.
    """
    n = int(p[0])
    forgetting = p[1]
    scratch = n * n
    spread = forgetting
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += s[i * n + j] * x[j]
        s[scratch + i] = total
        spread += total * x[i]
    if not spread > 0.0 or not spread < 1e300:
        return
    gain = error / spread
    for i in range(n):
        w[i] += gain * s[scratch + i]
    for i in range(n):
        row = s[scratch + i] / spread
        for j in range(i + 1):
            value = s[i * n + j] - row * s[scratch + j]
            s[i * n + j] = value
            s[j * n + i] = value
    # Inflate: scale row and column i by g_i so that the matrix stays symmetric and positive.
    root = forgetting**-0.5
    for i in range(n):
        own = s[i * n + i]
        grown = own / forgetting
        cap = p[2 + i]
        g = root if grown <= cap else (1.0 if own >= cap else (cap / own) ** 0.5)
        s[scratch + i] = g
    for i in range(n):
        for j in range(n):
            s[i * n + j] *= s[scratch + i] * s[scratch + j]


@register_learner
class Rls(Learner):
    """Least squares on line. `forgetting` (1) per update; `trust` is the ratio of the force expected of
    one interval to the noise of one sample, by which the first samples move the weights.
    """

    name = "rls"
    kernel = rls
    source = "Ljung and Soderstrom (1983); bounded forgetting after Salgado, Goodwin, Middleton (1988)"

    def __init__(self, forgetting: float = 0.9999, trust: float = 100.0) -> None:
        if not 0.9 <= forgetting <= 1.0:
            raise ConfigError(
                f"learner rls: forgetting is {forgetting:g}; allowed is 0.9 to 1", key=("forgetting",)
            )
        if not 1e-3 <= trust <= 1e9:
            raise ConfigError(f"learner rls: trust is {trust:g}; allowed is 1e-3 to 1e9", key=("trust",))
        self.forgetting = float(forgetting)
        self.trust = float(trust)

    def vector(self, scales: Floats) -> Floats:
        """Return N, forgetting, and the variances' caps: where they begin."""
        return np.concatenate([[scales.size, self.forgetting], (self.trust / scales) ** 2])

    def initial_state(self, scales: Floats) -> Floats:
        """Return the initial covariance, diagonal, and room for scratch."""
        return np.concatenate([np.diag((self.trust / scales) ** 2).ravel(), np.zeros(scales.size)])

    def information(self, state: Floats, scales: Floats) -> Floats:
        """Return the inverse of the covariance."""
        n = scales.size
        return np.asarray(np.linalg.inv(state[: n * n].reshape(n, n)))

    def to_dict(self) -> dict[str, Any]:
        """Return name, forgetting and trust."""
        return {"learner": self.name, "forgetting": self.forgetting, "trust": self.trust}
