"""The last link of the chain: a command that is a number, within the voltage and slew limits."""

from __future__ import annotations

import math

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats, compiled

LIMIT, STEP = 0, 1
"""Parameters: largest voltage (V), largest change between two ticks (V)."""
PARAMETERS = 2

APPLIED, FLAGS, CLAMPED_TICKS, SLEWED_TICKS, NOT_FINITE_TICKS = 0, 1, 2, 3, 4
"""State: voltage let through last (V), flags of the last tick, and the ticks counted for each flag."""
STATES = 5

_SMALLEST = 2.2250738585072014e-308
"""V below which a number has lost digits (denormal): such a command is zero."""

CLAMPED, SLEWED, NOT_FINITE = 1, 2, 4
"""Flags, added together in ``s[FLAGS]``."""


def limit_vector(voltage_limit: float, period: float, slew: float = math.inf) -> Floats:
    """Return the parameters of `limit_step`.

    `voltage_limit` in V, `period` of a tick in s, `slew` in V/s (infinite: no slew limit).
    Raise ConfigError where one is not a positive number.
    """
    for name, value, unit in (
        ("voltage_limit", voltage_limit, "V"),
        ("period", period, "s"),
        ("slew", slew, "V/s"),
    ):
        if not value > 0.0 or (name != "slew" and math.isinf(value)):
            raise ConfigError(f"limits: {name} is {value:g} {unit}; it must be a positive number")
    return np.array([voltage_limit, slew * period], dtype=np.float64)


def limit_state() -> Floats:
    """Return the state of `limit_step` before the first command: zero volts, nothing counted."""
    return np.zeros(STATES)


@compiled
def limit_step(p: Floats, s: Floats, volts: float) -> float:
    """Return the voltage (V) that may go out for the command `volts` (V); count and flag what was changed.

    Clamped to +-p[LIMIT], then to within p[STEP] of the voltage before. A command that is not finite
    becomes zero volts at once, whatever the slew: where the arithmetic has failed, nothing else is safe. A
    denormal one is zero: converters and other arithmetic do not agree on what it is.
    `s` is advanced in place; the result is always finite.
    """
    flags = 0.0
    out = volts
    if not math.isfinite(volts):
        out = 0.0
        flags = NOT_FINITE
        s[NOT_FINITE_TICKS] += 1.0
    else:
        if out > p[LIMIT]:
            out = p[LIMIT]
            flags += CLAMPED
        elif out < -p[LIMIT]:
            out = -p[LIMIT]
            flags += CLAMPED
        if flags != 0.0:
            s[CLAMPED_TICKS] += 1.0
        before = s[APPLIED]
        if out > before + p[STEP]:
            out = before + p[STEP]
            flags += SLEWED
            s[SLEWED_TICKS] += 1.0
        elif out < before - p[STEP]:
            out = before - p[STEP]
            flags += SLEWED
            s[SLEWED_TICKS] += 1.0
        if abs(out) < _SMALLEST:
            out = 0.0
    s[APPLIED] = out
    s[FLAGS] = flags
    return out
