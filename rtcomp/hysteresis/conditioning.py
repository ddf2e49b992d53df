"""Conditioning: one low-pass for position and force alike, before the identifier.

Noise in position is noise in the regressors, and the operator rectifies it: every small reversal is a
branch. Filtering only the position would shift it against the force; the same linear-phase filter on both
delays both alike and leaves their relation as it is, as long as the motion is slow against the cut-off.
"""

from __future__ import annotations

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats, compiled

ORDER = 4


def low_pass(cutoff_hz: float, rate_hz: float) -> Floats:
    """Return a Bessel low-pass (-3 dB at `cutoff_hz`), shape (sections, 5): b0 b1 b2 a1 a2 of each.

    Bessel because its delay is flat and its step response hardly overshoots (1 %; 2 % at a tenth of the
    rate): an overshoot is a reversal that never happened. A cut-off of 0 means no filter, shape (0, 5).
    Raises ConfigError above 0.4 of the rate.
    """
    if cutoff_hz == 0.0:
        return np.zeros((0, 5))
    if not 0.0 < cutoff_hz <= 0.4 * rate_hz:
        raise ConfigError(
            f"identify: smoothing is {cutoff_hz:g} Hz; "
            f"allowed is 0 (none) to {0.4 * rate_hz:g} Hz (0.4 of the rate)"
        )
    from scipy.signal import bessel

    sections = bessel(ORDER, cutoff_hz, fs=rate_hz, norm="mag", output="sos")
    return np.ascontiguousarray(np.delete(sections, 3, axis=1))


def memory(sections: Floats) -> Floats:
    """Return the state of `smooth` for these coefficients, shape (sections, 2)."""
    return np.zeros((sections.shape[0], 2))


@compiled
def settle(sections: Floats, state: Floats, value: float) -> None:
    """Set the state as if the filter had seen `value` for ever (its gain at 0 Hz is 1)."""
    for i in range(sections.shape[0]):
        b0, b2, a2 = sections[i, 0], sections[i, 2], sections[i, 4]
        b1, a1 = sections[i, 1], sections[i, 3]
        out = value * (b0 + b1 + b2) / (1.0 + a1 + a2)
        state[i, 1] = b2 * value - a2 * out
        state[i, 0] = out - b0 * value
        value = out


@compiled
def smooth(sections: Floats, state: Floats, value: float) -> float:
    """Filter one sample (transposed direct form II) and advance `state` in place."""
    for i in range(sections.shape[0]):
        out = sections[i, 0] * value + state[i, 0]
        state[i, 0] = sections[i, 1] * value - sections[i, 3] * out + state[i, 1]
        state[i, 1] = sections[i, 2] * value - sections[i, 4] * out
        value = out
    return value


def delay_s(sections: Floats, rate_hz: float) -> float:
    """Return the delay (s) of the filter at low frequency: its group delay at 0 Hz."""
    total = 0.0
    for b0, b1, b2, a1, a2 in sections:
        total += (b1 + 2 * b2) / (b0 + b1 + b2) - (a1 + 2 * a2) / (1.0 + a1 + a2)
    return total / rate_hz
