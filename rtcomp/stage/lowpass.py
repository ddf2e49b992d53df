"""The low-pass of every force balance: second-order Butterworth, there and back, so without delay.

Written out here because the library's own takes a third of a second to import, and a diagnosis is to say
within two where simulation and recording differ.
"""

from __future__ import annotations

import math

import numpy as np

from rtcomp.kernels import Floats, compiled

PAD = 9
"""Rows by which both ends are continued, mirrored about the end point."""


def section(cut_hz: float, rate_hz: float) -> Floats:
    """Return b0, b1, b2, a0, a1, a2 of a second-order Butterworth low-pass at `cut_hz` of rows at `rate_hz`.

    The bilinear transform with the cutoff prewarped. Raises ValueError where `cut_hz` is not below half of
    the rate.
    """
    if not 0.0 < cut_hz < 0.5 * rate_hz:
        raise ValueError(f"a cutoff of {cut_hz:g} Hz is not between 0 and half of {rate_hz:g} Hz")
    w = 1.0 / math.tan(math.pi * cut_hz / rate_hz)
    scale = 1.0 / (1.0 + math.sqrt(2.0) * w + w * w)
    return np.array(
        [scale, 2 * scale, scale, 1.0, 2 * scale * (1.0 - w * w), scale * (1.0 - math.sqrt(2.0) * w + w * w)]
    )


def resting(one: Floats) -> Floats:
    """Return the two states of the section `one` (transposed direct form) that has always seen 1."""
    return np.array([1.0 - one[0], one[2] - one[5]])


def zero_phase(signal: Floats, cut_hz: float, rate_hz: float) -> Floats:
    """Low-pass `signal`, (K,) or (K, p) by columns, K above 9, at `cut_hz`, there and back: no delay."""
    rows = np.asarray(signal, dtype=np.float64)
    if rows.shape[0] <= PAD:
        raise ValueError(f"{rows.shape[0]} rows; smoothing needs more than {PAD}")
    out = np.concatenate([2 * rows[0] - rows[PAD:0:-1], rows, 2 * rows[-1] - rows[-2 : -PAD - 2 : -1]])
    one = section(cut_hz, rate_hz)
    _there_and_back(one, resting(one), out.reshape(out.shape[0], -1))
    return out[PAD:-PAD]


@compiled
def _there_and_back(one: Floats, rest: Floats, x: Floats) -> None:
    b0, b1, b2, a1, a2 = one[0], one[1], one[2], one[4], one[5]
    rows, columns = x.shape
    s, t = np.empty(columns), np.empty(columns)
    for back in range(2):
        first = rows - 1 if back else 0
        for j in range(columns):
            s[j], t[j] = rest[0] * x[first, j], rest[1] * x[first, j]
        for i in range(rows):
            k = rows - 1 - i if back else i
            for j in range(columns):
                given = x[k, j]
                y = b0 * given + s[j]
                s[j] = b1 * given - a1 * y + t[j]
                t[j] = b2 * given - a2 * y
                x[k, j] = y
