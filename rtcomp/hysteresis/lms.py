"""Least-mean-square learners: the paper's rule (8) and its normalised form. O(N) a step."""

from __future__ import annotations

from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.learner import Learner, register_learner
from rtcomp.kernels import Floats, learner_kernel, regroup_kernel

FLOOR = 1e-4
"""Of the squared amplitudes, against division by nothing."""


@learner_kernel
def lms(p: Floats, s: Floats, x: Floats, w: Floats, error: float) -> None:
    """p: N, learning factor mu (1/m^2), step (1)."""
    gain = p[1] * error
    for i in range(int(p[0])):
        w[i] += gain * x[i]


@learner_kernel
def nlms(p: Floats, s: Floats, x: Floats, w: Floats, error: float) -> None:
    """p: N, step (1), floor of the squared norm (m^2)."""
    norm = p[2]
    for i in range(int(p[0])):
        norm += x[i] * x[i]
    gain = p[1] * error / norm
    for i in range(int(p[0])):
        w[i] += gain * x[i]


@regroup_kernel
def lms_regroup(p: Floats, s: Floats, scales: Floats, change: Floats) -> None:
    """Follow the amplitudes: they alone stand in the learning factor."""
    total = 0.0
    for i in range(int(p[0])):
        total += scales[i] * scales[i]
    p[1] = p[2] / total


@regroup_kernel
def nlms_regroup(p: Floats, s: Floats, scales: Floats, change: Floats) -> None:
    """Follow the amplitudes: they alone stand in the floor."""
    total = 0.0
    for i in range(int(p[0])):
        total += scales[i] * scales[i]
    p[2] = FLOOR * total


@register_learner
class Lms(Learner):
    """The paper's gradient rule, dw = mu * error * x; `step` is mu times the expected squared norm of x.

    A step of 2 is the limit of stability for regressors that are always fully exercised.
    """

    name = "lms"
    kernel = lms
    regroup = lms_regroup
    source = "the paper's equations (7), (8); Widrow and Hoff (1960)"

    def __init__(self, step: float = 0.02) -> None:
        self.step = _checked_step(self.name, step)

    def vector(self, scales: Floats) -> Floats:
        """Return N, mu = step / (sum of squared amplitudes), and step."""
        return np.array([scales.size, self.step / float(np.dot(scales, scales)), self.step])

    def initial_state(self, scales: Floats, likeness: Floats | None = None) -> Floats:
        """Return nothing: LMS has no memory but the weights."""
        return np.zeros(0)

    def to_dict(self) -> dict[str, Any]:
        """Return name and step."""
        return {"learner": self.name, "step": self.step}


@register_learner
class Nlms(Learner):
    """LMS normalised by the squared norm of the regressors: the same pace at any amplitude."""

    name = "nlms"
    kernel = nlms
    regroup = nlms_regroup
    source = "Nagumo and Noda (1967), IEEE TAC 12(3)"

    def __init__(self, step: float = 0.05) -> None:
        self.step = _checked_step(self.name, step)

    def vector(self, scales: Floats) -> Floats:
        """Return N, step, and a floor of 1e-4 of the squared amplitudes against division by nothing."""
        return np.array([scales.size, self.step, FLOOR * float(np.dot(scales, scales))])

    def initial_state(self, scales: Floats, likeness: Floats | None = None) -> Floats:
        """Return nothing: NLMS has no memory but the weights."""
        return np.zeros(0)

    def to_dict(self) -> dict[str, Any]:
        """Return name and step."""
        return {"learner": self.name, "step": self.step}


def _checked_step(name: str, step: float) -> float:
    if not 0.0 < step < 2.0:
        raise ConfigError(
            f"learner {name}: step is {step:g}; allowed is above 0 and below 2 (stability)", key=("step",)
        )
    return float(step)
