"""How far numbers scatter: between blocks left out, and of what happened once."""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats

MODEL = 0.004
"""Relative half width of an interval that no data removes: kernels are models, rows are discrete. With it,
beside blocks left out and replicates, 97 % of 91 numbers of a trial were within their intervals; with 0.002
93 %, with 0.015 99 %."""
BALANCE = 2e-3
"""Part of the drive's force (rms, as the fit weighs frequencies) up to which the balance in rows says nothing
of a number where no replicates tell how far it is off: what is a hundredth of the force is known to a fifth.
As much as trials' plants of other physics were missed by where all else was certain."""


def elsewhere(column: Floats, residual: Floats) -> float:
    """Return the mean square of the coefficients that `column` (n,) finds along the whole `residual` (n,).

    The variance of the number of what happened once: as large as what a residual that is alike for long makes
    of it where it did not happen.
    """
    found = np.fft.ifft(np.fft.fft(residual) * np.conj(np.fft.fft(column))).real
    return float(np.mean(found**2)) / float(column @ column) ** 2


def scatter(without: Floats) -> Floats:
    """Return the jackknife's covariance (q, q) of numbers found without each block in turn, (blocks, q).

    Neighbouring blocks are taken to be alike (Newey and West 1987, Econometrica 55(3), with one lag).
    """
    count = without.shape[0]
    apart = without - without.mean(axis=0)
    mixed = apart[1:].T @ apart[:-1]
    return np.asarray((apart.T @ apart + 0.5 * (mixed + mixed.T)) * (count - 1) / count)
