"""The null distribution of the one test: replicates of a model through the same screening."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.second.balance import ForceBalance
from rtcomp.diagnosis.second.fit import Fitted, Fitter
from rtcomp.diagnosis.second.replicate import replicate
from rtcomp.diagnosis.second.screening import Screen
from rtcomp.diagnosis.second.settings import REPLICATES
from rtcomp.diagnosis.second.significance import Null
from rtcomp.diagnosis.second.stage_of import stage_of
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats

FEW = 6
"""Replicates after which what is plain is settled."""


def free_columns(fitted: Fitted) -> Floats:
    """Return the columns (p, n) of a fit that are not at a bound, with its tangents."""
    c, prior = fitted.coefficients, fitted.prior
    slack = 1e-9 * np.abs(c)
    free = (c > prior.low + slack) & (c < prior.high - slack)
    return np.concatenate([fitted.system.columns[free], fitted.tangents])


def null_of(balance: ForceBalance, fitted: Fitted, screen: Screen, gain: float, seed: int) -> Null | None:
    """Return the null distribution beside a fitted model; None where it cannot be simulated.

    Replicates are drawn until it is plain whether `gain` and the error of the fit are beyond them: sequential
    Monte Carlo (Besag and Clifford 1991, Biometrika 78(2)).
    """
    try:
        stage = stage_of(balance, fitted, between=True)
    except ConfigError:
        return None
    motion = [p.x for p in balance.paths()]

    def one(number: int) -> tuple[float, float] | None:
        data = replicate(stage, balance.data, motion, balance.noise.rms, 1000 * seed + number)
        if data is None:
            return None
        other = balance.on(data)
        fitter = Fitter(other)
        fitter.offset = fitted.coefficients[balance.size - 1] != 0.0
        again = fitter.fit(list(fitted.terms), fitted, steps=0)
        gains = screen.gains(free_columns(again), again.residual)
        scale = balance.power / max(other.power, 1e-300)
        return max(s.gain for s in gains), float(again.errors.sum()) * scale

    found: list[tuple[float, float]] = []
    for first, last in ((0, FEW), (FEW, REPLICATES)):
        found += [f for f in shared(one, range(first, last)) if f is not None]
        if len(found) < FEW // 2:
            return None
        null = Null(*np.array(found).T)
        if null.plain(gain, float(fitted.errors.sum())):
            break
    return null


def best(names: Sequence[str], gains: Sequence[float], count: int) -> list[int]:
    """Return the numbers of the best `count` by gain, one of each name."""
    found: list[int] = []
    for i in np.argsort(-np.asarray(gains)).tolist():
        if all(names[i] != names[j] for j in found):
            found.append(i)
        if len(found) == count:
            break
    return found
