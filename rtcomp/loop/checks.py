"""What every sample is held against before anything is computed from it: is it new, is it possible?

Each check costs a comparison or two and is off where its setting is infinite.
"""

from __future__ import annotations

import math

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.loop.layout import (
    AGE,
    AGE_TICKS,
    CLOSED,
    COUNT,
    ESTOP,
    FROZEN,
    GOOD,
    HISTORY,
    INVALID_RUN,
    INVALID_TICKS,
    JUMP,
    JUMP_LIMIT,
    LAST_SEQUENCE,
    LAST_TIME,
    MEASURED_AT,
    MEASURED_SPEED,
    NO_POSITION,
    NOT_FINITE,
    OK,
    PERIOD,
    PUSHED,
    PUSHED_AT,
    PUSHED_MID,
    REPEATED,
    REPEATED_RUN,
    REPEATED_TICKS,
    ROW_DEVICE_TIME,
    ROW_OVERRUN,
    ROW_SEQUENCE,
    ROW_STATUS,
    SIGN,
    SIGN_TICKS,
    SIGN_VOLTS,
    SILENT,
    SINCE,
    SPEED,
    SPEED_LIMIT,
    STARTED,
    STUCK,
    STUCK_AT,
    STUCK_RUN,
    STUCK_TICKS,
    STUCK_VOLTS,
    TRAVEL,
    TRAVEL_HIGH,
    TRAVEL_LOW,
)
from rtcomp.loop.ring import STOPPED

STALE_STATUS, INVALID_STATUS, ESTOP_STATUS = 1.0, 2.0, 3.0
"""Status of a sample, as `device` has it."""
_BACK_COUNTS, _BACK_S = 128.0, 30.0
"""A count or a clock that goes back by less is an old sample, by more it has wrapped round."""
_SMALLEST = 2.2250738585072014e-308


@compiled
def is_new(state: Floats, row: Floats) -> bool:
    """Tell whether a sample that says it is new has a sequence and a device time that went forward.

    One that has not (frozen, sent twice, overtaken, played again) is counted; a counter may wrap round. A
    device that leaves a number at 0 does not count with it.
    """
    sequence, time = row[ROW_SEQUENCE], row[ROW_DEVICE_TIME]
    back, ago = state[LAST_SEQUENCE] - sequence, state[LAST_TIME] - time
    counts = sequence != 0.0 or state[LAST_SEQUENCE] != 0.0
    timed = time != 0.0 or state[LAST_TIME] != 0.0
    if (counts and 0.0 <= back < _BACK_COUNTS) or (timed and 0.0 <= ago < _BACK_S):
        state[REPEATED] += 1.0
        state[REPEATED_RUN] += 1.0
        return False
    state[LAST_SEQUENCE] = sequence
    state[LAST_TIME] = time
    state[REPEATED_RUN] = 0.0
    return True


@compiled
def check(
    settings: Floats, state: Floats, row: Floats, header: np.ndarray, position: float, fresh: bool
) -> int:
    """Return what is wrong with this tick's sample, `OK` where nothing is.

    `position` (m) is the measured one where the sample is `fresh`, else where the axis is taken to be.
    """
    if header[STOPPED] != 0 or row[ROW_STATUS] == ESTOP_STATUS:
        return ESTOP
    if fresh:
        state[AGE] = state[INVALID_RUN] = 0.0
    else:
        state[AGE] += 1.0
        if row[ROW_STATUS] == INVALID_STATUS:
            state[INVALID_RUN] += 1.0
            if state[INVALID_RUN] > settings[INVALID_TICKS]:
                return NO_POSITION
        if state[REPEATED_RUN] >= REPEATED_TICKS and math.isfinite(settings[AGE_TICKS]):
            return FROZEN
        if state[AGE] > settings[AGE_TICKS]:
            return SILENT
        if state[STARTED] == 0.0 and settings[CLOSED] > 0.0:
            return OK  # nothing is taken from it, and nothing goes out
    if not math.isfinite(position) or (position != 0.0 and abs(position) < _SMALLEST):
        return NOT_FINITE
    if position < settings[TRAVEL_LOW] or position > settings[TRAVEL_HIGH]:
        return TRAVEL
    if not fresh:
        state[SINCE] += 1.0
        return OK
    fault = moves(settings, state, position, row[ROW_OVERRUN] != 0.0 or state[GOOD] == 0.0)
    return fault if fault != OK else follows(settings, state, position)


@compiled
def moves(settings: Floats, state: Floats, position: float, loose: bool) -> int:
    """Tell whether the axis can have come here from where it was measured last, however long ago that is.

    SPEED: not so fast. JUMP: no force there is bends its way so much; over n ticks that is n (n + 1) / 2
    times as far as over one. `loose` where one of the two samples may be up to a period late. NaN, before
    there were two samples, passes.
    """
    ticks = state[SINCE] + 1.0
    moved = position - state[MEASURED_AT]
    more = 1.0 if loose else 0.0
    fault = OK
    if abs(moved) > settings[SPEED_LIMIT] * settings[PERIOD] * (ticks + more):
        fault = SPEED
    else:
        bend = abs(moved - state[MEASURED_SPEED] * ticks) - 2.0 * more * abs(state[MEASURED_SPEED])
        if bend > settings[JUMP_LIMIT] * 0.5 * ticks * (ticks + 1.0):
            fault = JUMP
    state[MEASURED_SPEED] = moved / ticks
    state[MEASURED_AT] = position
    state[SINCE] = 0.0
    return fault


@compiled
def follows(settings: Floats, state: Floats, position: float) -> int:
    """Tell whether the axis answers its drive: STUCK where it does not, SIGN where it runs against it.

    Stuck: driven with at least the voltage at which it must move, and not moved by more than a count, for as
    long as the settings say. Against: pushed one way for two windows, it went the other way in the second,
    and faster than in the first, which neither inertia nor friction does.
    """
    volts = state[HISTORY]
    if abs(volts) < settings[STUCK_VOLTS] or abs(position - state[STUCK_AT]) > settings[COUNT]:
        state[STUCK_RUN] = 0.0
        state[STUCK_AT] = position
    else:
        state[STUCK_RUN] += 1.0
        if state[STUCK_RUN] > settings[STUCK_TICKS]:
            return STUCK
    way = 1.0 if volts > 0.0 else -1.0
    if abs(volts) < settings[SIGN_VOLTS]:
        state[PUSHED] = 0.0
        return OK
    if state[PUSHED] * way <= 0.0:
        state[PUSHED] = 0.0
        state[PUSHED_AT] = position
    state[PUSHED] += way
    if state[PUSHED] * way == settings[SIGN_TICKS] + 1.0:
        state[PUSHED_MID] = position
    elif state[PUSHED] * way > 2.0 * settings[SIGN_TICKS]:
        before = way * (state[PUSHED_MID] - state[PUSHED_AT])
        after = way * (position - state[PUSHED_MID])
        state[PUSHED] = 0.0
        if after < -settings[COUNT] and after - before < -settings[COUNT]:
            return SIGN
    return OK
