"""Recursive least squares with forgetting and a wind-up guard. O(N^2) a step."""

from __future__ import annotations

from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.learner import Learner, register_learner
from rtcomp.hysteresis.moving.places import INTERVALS, MERGED, PART, SHARE, SPLIT
from rtcomp.kernels import Floats, compiled, learner_kernel, regroup_kernel

NOISE_MEMORY, PEAK_MEMORY = 1000.0, 20_000.0
"""Updates over which the errors are averaged, and in which the largest force is forgotten."""
LARGE = 0.5
"""Share of that from which on a force is large."""
UNSURE = 3.0
"""By which the variances grow where the elements change."""
SPLIT_TRUST = 0.01
"""Share of the first trust, squared, in which the two parts of a split element may differ."""


@compiled
def noise(s: Floats, x: Floats, w: Floats, error: float, n: int) -> float:
    """Return the mean square of the errors (N^2) where the friction is large, infinite where it is not.

    Only there its level shows; of small motions, which are foreseen far better, nothing is to be concluded
    for large ones.
    """
    mean = n * n + 2 * n
    force = 0.0
    for i in range(n):
        force += w[i] * x[i]
    force = abs(force)
    s[mean + 2] = max(force, s[mean + 2] * (1.0 - 1.0 / PEAK_MEMORY))
    if force < LARGE * s[mean + 2]:
        return np.inf
    s[mean + 1] = min(s[mean + 1] + 1.0, NOISE_MEMORY)
    s[mean] += (error * error - s[mean]) / s[mean + 1]
    return s[mean] if s[mean] > 0.0 else np.inf


@learner_kernel
def rls(p: Floats, s: Floats, x: Floats, w: Floats, error: float) -> None:
    """p: N, forgetting, cap of each variance in s (1/m^2, N entries), trust squared, drift squared.

    s: covariance (N x N) over the mean square of the errors (N^2), 2 N scratch, that mean, of how many, and
    the largest force (N).

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
    growths = scratch + n
    gain = error / spread
    shrink = 1.0 / spread
    level = p[3 + n] / noise(s, x, w, error, n) if p[3 + n] > 0.0 else 0.0
    root = forgetting**-0.5
    for i in range(n):
        along = s[scratch + i]
        w[i] += gain * along
        own = s[i * n + i] - along * along * shrink
        grown = own / forgetting
        cap = p[2 + i]
        s[growths + i] = root if grown <= cap else (1.0 if own >= cap else (cap / own) ** 0.5)
        if max(own, min(grown, cap)) + level * w[i] * w[i] > cap:
            level = 0.0
    # Row and column i are scaled by their growth; products commute, so that the matrix stays symmetric.
    for i in range(n):
        along, growth = s[scratch + i], s[growths + i]
        for j in range(n):
            value = s[i * n + j] - (along * s[scratch + j]) * shrink
            s[i * n + j] = value * (growth * s[growths + j]) + level * (w[i] * w[j])


@regroup_kernel
def rls_regroup(p: Floats, s: Floats, scales: Floats, change: Floats) -> None:
    """Carry the covariance over a merger by the integral and a split, whose two parts are known only as one.

    What was learned with the elements as they lay fits the new ones a little less: `UNSURE`.
    """
    n, count = int(p[0]), int(change[INTERVALS])
    i, k, share, part = int(change[MERGED]), int(change[SPLIT]), change[SHARE], change[PART]
    trusted = p[2 + n]
    for j in range(n):
        s[i * n + j] = share * s[i * n + j] + (1.0 - share) * s[(i + 1) * n + j]
    for j in range(n):
        s[j * n + i] = share * s[j * n + i] + (1.0 - share) * s[j * n + i + 1]
    # Slots between the merged and the split one move up or down by one.
    for a in range(i + 1, count - 1):
        for j in range(n):
            s[a * n + j] = s[(a + 1) * n + j]
    for a in range(i + 1, count - 1):
        for j in range(n):
            s[j * n + a] = s[j * n + a + 1]
    for a in range(count - 1, k, -1):
        for j in range(n):
            s[a * n + j] = s[(a - 1) * n + j]
    for a in range(count - 1, k, -1):
        for j in range(n):
            s[j * n + a] = s[j * n + a - 1]
    narrow = min(scales[k], scales[k + 1])
    apart = SPLIT_TRUST * trusted / (narrow * narrow)
    s[k * n + k] += (1.0 - part) * (1.0 - part) * apart
    s[(k + 1) * n + k + 1] += part * part * apart
    s[k * n + k + 1] -= part * (1.0 - part) * apart
    s[(k + 1) * n + k] -= part * (1.0 - part) * apart
    for a in range(n):
        p[2 + a] = trusted / (scales[a] * scales[a])
        s[n * n + a] = max(1.0, min(UNSURE, p[2 + a] / s[a * n + a])) ** 0.5
    for a in range(n):
        for j in range(n):
            s[a * n + j] *= s[n * n + a] * s[n * n + j]


@register_learner
class Rls(Learner):
    """Least squares on line. `forgetting` (1) per update; `trust` is the ratio of the force expected of
    one interval to the noise of one sample, by which the first samples move the weights. `drift` (1) is
    how far all of the friction may change, in proportion, from one update to the next (its standard
    deviation): friction that warms up or wears is followed as a whole, at once.
    """

    name = "rls"
    kernel = rls
    knows_likeness = True
    regroup = rls_regroup
    source = (
        "Ljung and Soderstrom (1983); bounded forgetting after Salgado, Goodwin, Middleton (1988); drift as "
        "process noise along the weights"
    )

    def __init__(self, forgetting: float = 0.9999, trust: float = 100.0, drift: float = 0.0) -> None:
        if not 0.9 <= forgetting <= 1.0:
            raise ConfigError(
                f"learner rls: forgetting is {forgetting:g}; allowed is 0.9 to 1", key=("forgetting",)
            )
        if not 1e-3 <= trust <= 1e9:
            raise ConfigError(f"learner rls: trust is {trust:g}; allowed is 1e-3 to 1e9", key=("trust",))
        if not 0.0 <= drift <= 0.1:
            raise ConfigError(f"learner rls: drift is {drift:g}; allowed is 0 to 0.1", key=("drift",))
        self.drift = float(drift)
        self.forgetting = float(forgetting)
        self.trust = float(trust)

    def vector(self, scales: Floats) -> Floats:
        """Return N, forgetting, the variances' caps, where they begin, trust squared and drift squared."""
        caps = (self.trust / scales) ** 2
        return np.concatenate([[scales.size, self.forgetting], caps, [self.trust**2, self.drift**2]])

    def initial_state(self, scales: Floats, likeness: Floats | None = None) -> Floats:
        """Return the initial covariance, diagonal but for what is alike, and room for scratch."""
        n = scales.size
        alike = np.eye(n)
        if likeness is not None:
            alike[: len(likeness), : len(likeness)] = likeness
        deviation = self.trust / scales
        return np.concatenate([(alike * np.outer(deviation, deviation)).ravel(), np.zeros(2 * n + 3)])

    def information(self, state: Floats, scales: Floats) -> Floats:
        """Return the inverse of the covariance."""
        n = scales.size
        return np.asarray(np.linalg.inv(state[: n * n].reshape(n, n)))

    def to_dict(self) -> dict[str, Any]:
        """Return name, forgetting and trust."""
        return {"learner": self.name, "forgetting": self.forgetting, "trust": self.trust, "drift": self.drift}
