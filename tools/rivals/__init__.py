"""Rivals of the interval operator for measured hysteresis, each a small file with its source, one interface.

They are fitted off line, by least squares over all training motions at once, which is kinder to them than
learning on line is. `ridge` (1) weighs the squares of normalised weights against the squared error a sample;
who compares them chooses it alike for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rtcomp.kernels import Floats


@dataclass(frozen=True)
class Motion:
    """An input and the measured output, (K,) each; `before` (L,) is what the memory saw ahead of them."""

    name: str
    u: Floats
    y: Floats
    before: Floats


class Rival(Protocol):
    """A model of hysteresis that can be fitted and asked."""

    name: str
    source: str

    def fit(self, motions: Sequence[Motion], ridge: float) -> None:
        """Find the parameters."""

    def predict(self, u: Floats, before: Floats) -> Floats:
        """Return the output along `u` (K,) after `before`, with frozen parameters."""

    def numbers(self) -> int:
        """Return how many float64 parameters and memory take."""


def solve(x: Floats, y: Floats, ridge: float) -> Floats:
    """Return the weights of the columns of `x` (K, N) least in squares, `ridge` on columns of unit rms."""
    size = np.sqrt(np.mean(x**2, axis=0))
    size[size == 0.0] = 1.0
    a = x / size
    gram = a.T @ a / len(y) + (ridge + 1e-12) * np.eye(x.shape[1])
    return np.asarray(np.linalg.solve(gram, a.T @ y / len(y)) / size)


def amplitude(motions: Sequence[Motion]) -> float:
    """Return the largest input in size."""
    return float(max(np.abs(np.concatenate([m.u, m.before])).max() for m in motions))


def error(rival: Rival, motions: Sequence[Motion]) -> float:
    """Return the rms error over all samples of `motions`, in the output's unit."""
    return float(np.sqrt(np.mean(np.concatenate([rival.predict(m.u, m.before) - m.y for m in motions]) ** 2)))
