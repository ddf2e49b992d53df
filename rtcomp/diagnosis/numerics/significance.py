"""The one test: is a gain larger than the largest that all candidates make where nothing is missing?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtcomp.kernels import Floats

SURE = 2.0
"""Standard errors by which a value must be away from what it is compared with to be plain."""
MEAN, KURTOSIS = 0.5772156649, 5.4
"""Of Gumbel's law: its mean over its scale, its fourth moment over its variance squared."""


@dataclass(frozen=True)
class Null:
    """What replicates show: their largest gains, (R,), and the squared errors that they leave, (R, B)."""

    gains: Floats
    errors: Floats
    numbers: Floats | None = None
    """(R, p + q): what a fit of each finds of the numbers that made it; None where none was made."""
    in_full: Callable[[Any], Floats] | None = None
    """Tells what fits of some of them gain by one more effect, (r,); None where there are none."""

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
        return float(self.gains.mean() + self.gains.std(ddof=1) * _at_level(level))

    def p_of_error(self, errors: Floats) -> float:
        """Return the probability of squared errors (B,) as large where the model is the whole truth.

        What counts is the mean of their logarithms over blocks, as for a gain: a single block in which an
        unstable axis went another way says little of the others.
        """
        return _gumbel_tail(_level(self.errors), float(_level(errors)))

    def as_loud(self, errors: Floats, level: float) -> bool:
        """Tell whether squared errors (B,) are neither larger nor smaller than chance has them."""
        usual, value = _level(self.errors), float(_level(errors))
        return min(_gumbel_tail(usual, value), _gumbel_tail(-usual, -value)) > level

    def settled(self, gain: float, errors: Floats, level: float) -> bool:
        """Tell whether neither the largest gain nor the errors left are more than chance at `level`."""
        return self.p_value(gain) > level and self.p_of_error(errors) > level

    def plain(self, gain: float, errors: Floats, level: float) -> bool:
        """Tell whether more replicates would change no decision at `level` on this gain and these errors."""
        return _plain(self.gains, gain, level) and _plain(_level(self.errors), float(_level(errors)), level)


def _level(errors: Floats) -> Floats:
    return np.asarray(np.log(np.maximum(errors, 1e-300)).mean(axis=-1))


def _scaled(sample: Floats, value: float) -> float:
    """Return a value less the mean of a sample, over its standard deviation."""
    mean = float(sample.mean())
    return (value - mean) / max(float(sample.std(ddof=1)), 1e-9 * abs(mean) + 1e-12)


def _gumbel_tail(sample: Floats, value: float) -> float:
    at = _scaled(sample, value) * np.pi / np.sqrt(6.0) + MEAN
    return float(-np.expm1(-np.exp(-np.clip(at, -30.0, 700.0))))


def _at_level(level: float) -> float:
    """Return how many standard deviations above its mean a Gumbel law's tail is `level`."""
    return float((-np.log(-np.log1p(-level)) - MEAN) * np.sqrt(6.0) / np.pi)


def _plain(sample: Floats, value: float, level: float) -> bool:
    """Tell whether a value is so far from the `level` that errors of the sample's moments do not matter.

    Those of its mean and of the logarithm of its deviation are taken from large samples.
    """
    z, limit = _scaled(sample, value), _at_level(level)
    shift = SURE / np.sqrt(sample.size)
    spread = shift * np.sqrt(0.25 * (KURTOSIS - 1.0))
    below = z + np.hypot(shift, max(z, 0.0) * spread) < limit
    return bool(below or z * np.exp(-spread) - shift > limit)


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


def probabilities(
    errors: Sequence[Floats], rows: float, sizes: Sequence[int], seed: int = 0, draws: int = 1000
) -> Floats:
    """Return the weights (M,) of models by pseudo-BMA with a Bayesian bootstrap over blocks (pseudo-BMA+).

    `errors` are squared errors in blocks, (B,) each, of `rows` independent numbers (Yao, Vehtari, Simpson,
    Gelman 2018, Bayesian Analysis 13(3)). They are of fits to these rows, which each of its parameters, so
    many as `sizes` says, makes likelier by one than they are elsewhere (Akaike 1974, IEEE Trans. AC 19(6)).
    """
    loss = -0.5 * np.log(np.array(errors)) * rows
    random = np.random.default_rng(seed)
    weights = random.dirichlet(np.ones(loss.shape[1]), draws)
    score = loss.shape[1] * weights @ loss.T - np.asarray(sizes, dtype=np.float64)
    score -= score.max(axis=1, keepdims=True)
    each = np.exp(score)
    each /= each.sum(axis=1, keepdims=True)
    return np.asarray(each.mean(axis=0))
