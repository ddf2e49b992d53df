"""The one test: is a gain larger than the largest that all candidates make where nothing is missing?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.kernels import Floats

PLAIN = (1e-8, 0.3)
"""P-values of a few replicates, below and above which the level is far away, however few they are."""


@dataclass(frozen=True)
class Null:
    """Largest gains, one a replicate, (R,), and squared errors that replicates leave in blocks, (R, B)."""

    gains: Floats
    errors: Floats

    @property
    def noise(self) -> float:
        """Squared error that noise, and the method's own errors, usually leave in all blocks."""
        return float(np.median(self.errors.sum(axis=1)))

    def p_value(self, gain: float) -> float:
        """Return the probability of a gain as large where nothing is missing.

        The tail is that of a Gumbel law (largest of many; Gumbel 1958, Statistics of Extremes) by moments.
        """
        return _gumbel_tail(self.gains, gain)

    def threshold(self, level: float) -> float:
        """Return the gain that has this p-value."""
        spread = float(self.gains.std(ddof=1)) * np.sqrt(6.0) / np.pi
        return float(self.gains.mean() - 0.5772156649 * spread - spread * np.log(-np.log1p(-level)))

    def p_of_error(self, errors: Floats) -> float:
        """Return the probability of squared errors (B,) as large where the model is the whole truth.

        What counts is the mean of their logarithms over blocks, as for a gain: a single block in which an
        unstable axis went another way says little of the others.
        """
        return _gumbel_tail(_level(self.errors), float(_level(errors)))

    def settled(self, gain: float, errors: Floats, level: float) -> bool:
        """Tell whether neither the largest gain nor the errors left are more than chance at `level`."""
        return self.p_value(gain) > level and self.p_of_error(errors) > level

    def plain(self, gain: float, errors: Floats) -> bool:
        """Tell whether more replicates would change no decision on this gain and these errors."""
        return all(p < PLAIN[0] or p > PLAIN[1] for p in (self.p_value(gain), self.p_of_error(errors)))


def _level(errors: Floats) -> Floats:
    return np.asarray(np.log(np.maximum(errors, 1e-300)).mean(axis=-1))


def _gumbel_tail(sample: Floats, value: float) -> float:
    spread = max(float(sample.std(ddof=1)), 1e-9 * abs(float(sample.mean())) + 1e-12)
    scale = spread * np.sqrt(6.0) / np.pi
    at = float(sample.mean()) - 0.5772156649 * scale
    return float(-np.expm1(-np.exp(-np.clip((value - at) / scale, -30.0, 700.0))))


def log_gain(before: Floats, after: Floats) -> float:
    """Return the mean over blocks of log(squared error before / after), (B,) each."""
    return float(np.mean(np.log(before / after)))


def confidence_set(errors: Sequence[Floats], level: float, seed: int = 0, draws: int = 999) -> list[int]:
    """Return the models, by number, that are not worse than the best at `level`: the model confidence set.

    `errors` are squared errors of the blocks left out, (B,) each. The worst of the set is taken out as long
    as the largest standardised loss is significant, by a bootstrap over blocks (Hansen, Lunde, Nason 2011,
    Econometrica 79(2)).
    """
    loss = np.log(np.array(errors))
    random = np.random.default_rng(seed)
    blocks = loss.shape[1]
    drawn = random.integers(0, blocks, (draws, blocks))
    members = list(range(loss.shape[0]))
    while len(members) > 1:
        own = loss[members]
        apart = own.mean(axis=1) - own.mean()
        means = own[:, drawn].mean(axis=2)
        shaken = means - means.mean(axis=0) - apart[:, None]
        spread = np.sqrt(np.mean(shaken**2, axis=1)) + 1e-300
        statistic = apart / spread
        null = (shaken / spread[:, None]).max(axis=0)
        if np.mean(null >= statistic.max()) > level:
            break
        members.pop(int(np.argmax(statistic)))
    return members


def probabilities(errors: Sequence[Floats], rows: float, seed: int = 0, draws: int = 1000) -> Floats:
    """Return the weights (M,) of models by pseudo-BMA with a Bayesian bootstrap over blocks (pseudo-BMA+).

    `errors` are squared errors of blocks left out, (B,) each, of `rows` independent numbers (Yao, Vehtari,
    Simpson, Gelman 2018, Bayesian Analysis 13(3)).
    """
    loss = -0.5 * np.log(np.array(errors)) * rows
    random = np.random.default_rng(seed)
    weights = random.dirichlet(np.ones(loss.shape[1]), draws)
    score = loss.shape[1] * weights @ loss.T
    score -= score.max(axis=1, keepdims=True)
    each = np.exp(score)
    each /= each.sum(axis=1, keepdims=True)
    return np.asarray(each.mean(axis=0))
