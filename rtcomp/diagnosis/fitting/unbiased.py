"""The bias of a fit, by replicates: recordings of a model whose numbers are known, fitted again.

What a sensor cannot tell bends a fit: friction that goes along with the drive within a count looks like a
weight that is less. On replicates of the fit it does the same, so what their numbers are off by on average is
taken from those of the fit (bootstrap estimate of bias: Efron, Tibshirani 1993, An Introduction to the
Bootstrap, chapter 10).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats


def numbers_of(fitter: Fitter, fitted: Fitted) -> Floats:
    """Return the coefficients and the changes of nonlinear parameters, (p + q,), one step on from a fit."""
    joint, prior = fitter.jointly(fitted, fitted.tangents)
    return joint.solve(fitter.use, prior, fitted.variance)


def unbiased(fitter: Fitter, fitted: Fitted, numbers: Floats) -> Fitted:
    """Return a fit without the bias that the `numbers` of its replicates, (R, p + q), have on average.

    With the numbers it had where the model cannot have others.
    """
    off = numbers.mean(axis=0) - fitted.whole
    with suppress(ConfigError):
        fitted = fitter.moved_by(fitted, -off)
    return replace(fitted, off=off)
