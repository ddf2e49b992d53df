"""The feedback controller: PID with a filtered derivative and anti-windup.

    volts = kp e + I + D,    dI/dt = ki e,    Tf dD/dt + D = kd de/dt

with e = reference - position (m), kp in V/m, ki in V/(m s), kd in V s/m. `I` and `D` are kept in volts, so
that gains may change while running without a jump. Discretised exactly for an error that runs straight
between ticks (first-order hold): trapezoidal integral, low-pass of the difference quotient with the pole
exp(-T / Tf). Compiled functions on one parameter and one state array; the tick calls them.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats, compiled

KP, KI, KD, POLE, ON_MEASUREMENT, TRACKING, INTEGRAL_LIMIT, PERIOD = 0, 1, 2, 3, 4, 5, 6, 7
"""Parameters: gains (V/m, V/(m s), V s/m); pole of the derivative's filter; 1 where the derivative is of
the measurement only; share of the excess taken back a tick, or -1 for conditional integration; bound of the
integral part (V); period of a tick (s)."""
PARAMETERS = 8

INTEGRAL, DERIVATIVE, LAST_ERROR, LAST_INPUT, STARTED = 0, 1, 2, 3, 4
"""State: integral and derivative part (V); error (m) and derivative's input (m) of the tick before; 1 after
the first tick."""
STATES = 5

Derivative = Literal["measurement", "error"]
AntiWindup = Literal["back-calculation", "conditional", "none"]


def pid_vector(
    kp: float,
    ki: float = 0.0,
    kd: float = 0.0,
    *,
    period: float,
    derivative: Derivative = "error",
    derivative_time: float | None = None,
    anti_windup: AntiWindup = "back-calculation",
    tracking_time: float | None = None,
    voltage_limit: float = math.inf,
) -> Floats:
    """Return the parameters of `pid_step`, shape (PARAMETERS,).

    kp (V/m), ki (V/(m s)), kd (V s/m) are not negative; `period` (s) is that of a tick. `derivative` is of
    the ``"error"``, which tracks a moving reference without lag, or of the ``"measurement"`` alone, which
    does not kick when the reference jumps. `derivative_time` (s) is the filter's time constant, by default
    twice the period; 0 is the plain difference. `tracking_time` (s) is the time in which the integral lets go
    of an excess, by default sqrt(Ti Td) with a derivative and Ti = kp / ki without (Astrom and Hagglund,
    Advanced PID Control, 2006, section 3.5). The integral part never passes +-`voltage_limit` (V).

    Raise ConfigError where a value is negative or not a number, or a name is unknown.
    """
    filtering = 2.0 * period if derivative_time is None else derivative_time
    for name, value, unit in (
        ("kp", kp, "V/m"),
        ("ki", ki, "V/(m s)"),
        ("kd", kd, "V s/m"),
        ("derivative_time", filtering, "s"),
    ):
        if not (math.isfinite(value) and value >= 0.0):
            raise ConfigError(f"controller: {name} is {value:g} {unit}; it must be 0 or positive")
    if not (math.isfinite(period) and period > 0.0):
        raise ConfigError(f"controller: period is {period:g} s; it must be positive")
    if not voltage_limit > 0.0:
        raise ConfigError(f"controller: voltage_limit is {voltage_limit:g} V; it must be positive")
    if derivative not in ("measurement", "error"):
        raise ConfigError(f"controller: derivative is {derivative!r}; it must be 'measurement' or 'error'")
    if anti_windup == "none":
        share = 0.0
    elif anti_windup == "conditional":
        share = -1.0
    elif anti_windup == "back-calculation":
        time = _tracking_time(kp, ki, kd) if tracking_time is None else tracking_time
        if not time > 0.0 and tracking_time is not None:
            raise ConfigError(f"controller: tracking_time is {time:g} s; it must be positive")
        # More than the whole excess a tick would overshoot it: the loop through the limit would ring.
        share = period / max(time, period) if ki > 0.0 else 0.0
    else:
        raise ConfigError(
            f"controller: anti_windup is {anti_windup!r}; "
            "it must be 'back-calculation', 'conditional' or 'none'"
        )
    pole = math.exp(-period / filtering) if filtering > 0.0 else 0.0
    on_measurement = 1.0 if derivative == "measurement" else 0.0
    return np.array([kp, ki, kd, pole, on_measurement, share, voltage_limit, period], dtype=np.float64)


def _tracking_time(kp: float, ki: float, kd: float) -> float:
    if ki == 0.0:
        return math.inf
    return math.sqrt(kd / ki) if kd > 0.0 else kp / ki


def pid_state() -> Floats:
    """Return the state of `pid_step` before the first tick, shape (STATES,)."""
    return np.zeros(STATES)


@compiled
def pid_step(p: Floats, s: Floats, error: float, position: float, excess: float) -> float:
    """Return the controller's voltage (V) for this tick and advance `s` in place.

    `error` = reference - position (m). `excess` (V) is what the limits did to the tick before: voltage
    applied minus voltage asked for, feedforward included; 0 where nothing was cut. The first tick only takes
    the starting point: its derivative and integral do not move. Where `error` or `position` is not finite the
    result is NaN and the state stays as it was.
    """
    if not (math.isfinite(error) and math.isfinite(position)):
        return math.nan
    source = -position if p[ON_MEASUREMENT] == 1.0 else error
    pull = excess if math.isfinite(excess) else 0.0
    gain = 0.0
    if s[STARTED] == 0.0:
        s[STARTED] = 1.0
        s[LAST_INPUT] = source
    else:
        gain = 0.5 * p[KI] * p[PERIOD] * (error + s[LAST_ERROR])
    if p[TRACKING] < 0.0:
        if pull * gain < 0.0:
            gain = 0.0
    else:
        gain += p[TRACKING] * pull
    s[INTEGRAL] = min(max(s[INTEGRAL] + gain, -p[INTEGRAL_LIMIT]), p[INTEGRAL_LIMIT])
    rate = p[KD] * (source - s[LAST_INPUT]) / p[PERIOD]
    s[DERIVATIVE] = p[POLE] * s[DERIVATIVE] + (1.0 - p[POLE]) * rate
    s[LAST_ERROR] = error
    s[LAST_INPUT] = source
    return float(p[KP] * error + s[INTEGRAL] + s[DERIVATIVE])


@compiled
def pid_preset(p: Floats, s: Floats, error: float, position: float, volts: float) -> None:
    """Set `s` so that the controller, started at this `error` and `position` (m), asks for `volts` (V).

    For taking over without a bump. The integral part takes what the proportional part leaves, within its
    bound; at a constant error the next `pid_step` returns `volts` plus one tick's integral.
    """
    s[DERIVATIVE] = 0.0
    s[LAST_ERROR] = error
    s[LAST_INPUT] = -position if p[ON_MEASUREMENT] == 1.0 else error
    s[STARTED] = 1.0
    s[INTEGRAL] = min(max(volts - p[KP] * error, -p[INTEGRAL_LIMIT]), p[INTEGRAL_LIMIT])
