"""The projected gradient estimator used with stop operators: the weights stay non-negative. O(N) a step.

Kuhnen keeps the weights of a Prandtl-Ishlinskii model inside the convex set on which the model has an
inverse. For a bank of stops or plays that set is w_i >= 0, and the projection onto it is taken weight by
weight. Kuhnen's estimator runs in continuous time, dw/dt = P{Gamma x e}; here it is sampled and normalised,
so that no step can be too large for the motion's size:

    w <- max(0, w + step * Gamma x e / (c + x' Gamma x)),    Gamma = diag(1 / amplitude_i^2)

The diagonal metric leaves the projection where it is. Kuhnen and Janocha (1999), European Control Conference;
Kuhnen (2003), European J. Control 9(4); normalisation after Goodwin and Sin (1984).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.learner import Learner, register_learner
from rtcomp.kernels import Floats, learner_kernel, regroup_kernel


@learner_kernel
def projected_gradient(p: Floats, s: Floats, x: Floats, w: Floats, error: float) -> None:
    """p: N, step (1), floor c (1), then the diagonal of Gamma (1/m^2, N entries); no state."""
    count = int(p[0])
    norm = p[2]
    for i in range(count):
        norm += p[3 + i] * x[i] * x[i]
    gain = p[1] * error / norm
    for i in range(count):
        w[i] = max(w[i] + gain * p[3 + i] * x[i], 0.0)


@regroup_kernel
def gradient_regroup(p: Floats, s: Floats, scales: Floats, change: Floats) -> None:
    """Follow the amplitudes, in Gamma."""
    for i in range(int(p[0])):
        p[3 + i] = 1.0 / (scales[i] * scales[i])


@register_learner
class Gradient(Learner):
    """Projected, normalised gradient; `step` (1) is the share of the error taken away at once, below 2."""

    name = "gradient"
    kernel = projected_gradient
    regroup = gradient_regroup
    source = "Kuhnen and Janocha (1999), ECC; Kuhnen (2003), European J. Control 9(4)"

    def __init__(self, step: float = 0.05) -> None:
        if not 0.0 < step < 2.0:
            raise ConfigError(
                f"learner gradient: step is {step:g}; allowed is above 0 and below 2 (stability)",
                key=("step",),
            )
        self.step = float(step)

    def vector(self, scales: Floats) -> Floats:
        """Return N, step, the floor (1e-4 of the norm when all is exercised) and Gamma."""
        return np.concatenate([[scales.size, self.step, 1e-4 * scales.size], 1.0 / scales**2])

    def initial_state(self, scales: Floats, likeness: Floats | None = None) -> Floats:
        """Return nothing: the estimator has no memory but the weights."""
        return np.zeros(0)

    def to_dict(self) -> dict[str, Any]:
        """Return name and step."""
        return {"learner": self.name, "step": self.step}
