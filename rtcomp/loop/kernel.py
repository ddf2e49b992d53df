"""The tick's arithmetic, compiled: check, identify, keep pace, compensate, limit, hand over to the ring.

Pure functions on preallocated arrays; `layout` says what stands where, `tick` puts the arrays together.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rtcomp.control.limits import FLAGS, limit_step
from rtcomp.control.limits import NOT_FINITE as NO_NUMBER
from rtcomp.control.pid import INTEGRAL, INTEGRAL_LIMIT, KI, LAST_INPUT, ON_MEASUREMENT, pid_step
from rtcomp.hysteresis.conditioning import settle, smooth
from rtcomp.hysteresis.moving.places import CHANGED
from rtcomp.kernels import Floats, call_basis, call_learner, call_placing, call_regroup, compiled
from rtcomp.loop import layout as at
from rtcomp.loop.checks import STALE_STATUS, check, is_new
from rtcomp.loop.pace import degrade, keep_pace, lose_slot
from rtcomp.loop.push import push
from rtcomp.loop.states import State

_COLUMNS = len(at.COLUMNS)
_PART, _BLOWN_UP = 16, 1e200
_RUNNING, _FAULT = float(State.RUNNING), float(State.FAULT)


class Identifier(NamedTuple):
    """The identifying half of the tick: a basis driven by the measurement, and what learns its weights."""

    basis: int
    bp: Floats
    bs: Floats
    x: Floats
    learner: int
    lp: Floats
    ls: Floats
    w: Floats
    sections: Floats
    position_memory: Floats
    force_memory: Floats
    ls_kept: Floats
    """The learner's state and the weights at the start, and later those that proved good: what is gone back
    to where learning diverges, or foresees less than they do."""
    w_kept: Floats
    scales: Floats
    """Amplitude of each regressor (m), the offset's too."""
    placing: int
    """What moves the elements, 0 where they stay; its memory, and what it changed last."""
    places: Floats
    change: Floats
    regroup: int


class Compensator(NamedTuple):
    """The compensating half: the same basis with a state of its own, driven by the reference; PID; limits."""

    bs: Floats
    x: Floats
    pid_p: Floats
    pid_s: Floats
    limit_p: Floats
    limit_s: Floats


@compiled
def identify(
    i: Identifier, c: Compensator, settings: Floats, state: Floats, known: float, learn: float, row: Floats
) -> None:
    """Feed the measurement of one tick ago, whose force is known by now, to the basis and the learner.

    The command is constant between ticks, so the force around a sample is the mean of the commands before
    and after it, and the acceleration that belongs to it is the second difference of position.
    """
    period, delay = settings[at.PERIOD], int(settings[at.DELAY])
    x0, x1, x2 = row[at.ROW_POSITION], state[at.X1], state[at.X2]
    volts = 0.5 * (state[at.HISTORY + delay] + state[at.HISTORY + delay + 1])
    force = settings[at.FORCE_CONSTANT] * volts - known
    force -= settings[at.MASS] * (x0 - 2.0 * x1 + x2) / (period * period)
    force -= settings[at.VISCOUS] * (x0 - x2) / (2.0 * period)
    position = smooth(i.sections, i.position_memory, x1)
    force = smooth(i.sections, i.force_memory, force)
    call_basis(i.basis, i.bp.ctypes.data, i.bs.ctypes.data, i.x.ctypes.data, position)
    model = says(i)
    if not abs(model) < settings[at.FORCE_BOUND]:  # also where it is no number
        put_aside(i, state)
        model = says(i)
    row[at.ROW_FORCE] = force
    row[at.ROW_FORCE_MODEL] = model
    error = force - model
    moved = abs(position - state[at.LEARNED_AT])
    if abs(position - state[at.RESTED_AT]) > settings[at.COUNT]:
        state[at.BEYOND] += 1.0
        if state[at.BEYOND] >= at.MOVES_TICKS or state[at.RESTED] < at.REST_TICKS:
            state[at.RESTED_AT] = position
            state[at.RESTED] = state[at.BEYOND] = 0.0
    else:  # noise alone would move the weights without end
        state[at.BEYOND] = 0.0
        state[at.RESTED] += 1.0
    may = state[at.HELD] == 0.0 and (state[at.RESTED] < at.REST_TICKS or settings[at.COUNT] == 0.0)
    learns = learn > 0.0 and may and moved >= settings[at.GATE] and math.isfinite(error)
    if learns:
        state[at.LEARNED_AT] = position
        state[at.UPDATES] += 1.0
        compare(i, state, error, force)
        call_learner(i.learner, i.lp.ctypes.data, i.ls.ctypes.data, i.x.ctypes.data, i.w.ctypes.data, error)
        row[at.ROW_LEARNING] = 1.0
        if not (abs(says(i)) < settings[at.FORCE_BOUND] and sound(i.ls, int(state[at.UPDATES]))):
            put_aside(i, state)
        elif state[at.TRIED] >= at.COMPARED:
            guard(i, state)
    if i.placing != 0 and learn > 0.0 and state[at.HELD] == 0.0 and math.isfinite(force):
        move_elements(i, c, force, error if learns else math.nan)


@compiled
def compare(i: Identifier, state: Floats, error: float, force: float) -> None:
    """Average what the weights, and those kept, did not foresee of a force that neither has learned."""
    state[at.TRIED] += 1.0
    count = state[at.TRIED] - at.SETTLING
    if count > 0.0:
        kept = force
        for j in range(i.w.size):
            kept -= i.w_kept[j] * i.x[j]
        part = 1.0 / min(count, at.COMPARE_MEMORY)
        state[at.OWN_OFF] += part * (error * error - state[at.OWN_OFF])
        state[at.KEPT_OFF] += part * (kept * kept - state[at.KEPT_OFF])


@compiled
def guard(i: Identifier, state: Floats) -> None:
    """Take the weights back where those kept foresee much more; keep them where they foresee no less."""
    if state[at.OWN_OFF] > at.WORSE * state[at.KEPT_OFF]:
        i.ls[:] = i.ls_kept
        i.w[:] = i.w_kept
        state[at.TAKEN_BACK] += 1.0
        state[at.TRIED] = 0.0
    elif state[at.TRIED] >= at.KEPT_EVERY:
        if state[at.OWN_OFF] <= state[at.KEPT_OFF]:
            i.ls_kept[:] = i.ls
            i.w_kept[:] = i.w
        state[at.TRIED] = at.SETTLING
        state[at.OWN_OFF] = state[at.KEPT_OFF] = 0.0


@compiled
def move_elements(i: Identifier, c: Compensator, force: float, error: float) -> None:
    """Let the elements of the basis move, and the learner's memory follow them."""
    call_placing(
        i.placing, i.bp.ctypes.data, i.bs.ctypes.data, i.x.ctypes.data, c.bs.ctypes.data, c.x.ctypes.data,
        i.w.ctypes.data, i.w_kept.ctypes.data, i.scales.ctypes.data, i.places.ctypes.data,
        i.change.ctypes.data, force, error,
    )  # fmt: skip
    if i.change[CHANGED] > 0.0:
        for state in (i.ls, i.ls_kept):
            call_regroup(i.regroup, i.lp.ctypes.data, state.ctypes.data, i.scales.ctypes.data,
                         i.change.ctypes.data)  # fmt: skip


@compiled
def says(i: Identifier) -> float:
    """Return the model's force (N) for the identifier's regressors."""
    total = 0.0
    for j in range(i.w.size):
        total += i.w[j] * i.x[j]
    return total


@compiled
def sound(ls: Floats, turn: int) -> bool:
    """Tell whether the learner's state holds numbers: a part of it at each update, all of it in turn."""
    total = 0.0
    for j in range(min(_PART, ls.size)):
        total += abs(ls[(turn * _PART + j) % ls.size])
    return total < _BLOWN_UP


@compiled
def put_aside(i: Identifier, state: Floats) -> None:
    """Take a diverged identifier back to what was kept, and let it rest; the third time for good."""
    i.ls[:] = i.ls_kept
    i.w[:] = i.w_kept
    state[at.DIVERGED] += 1.0
    state[at.TRIED] = 0.0
    state[at.CHANGED] = 1.0
    state[at.HELD] = at.HELD_TICKS if state[at.DIVERGED] < at.MOST_DIVERGED else math.inf


@compiled
def hand_over(c: Compensator, state: Floats, full: float) -> float:
    """Return the integral (V) that goes with the share of feedforward, of which `full` (V) is all.

    As feedforward goes off at once, the integral takes over what it gave. As it fades back, the integral
    gives up what it has gained since, no more: in a short gap feedback has carried little of the friction.
    A model that was put aside comes back as another, after long: then it gives up what feedforward brings.
    """
    integral, share, last = c.pid_s[INTEGRAL], state[at.SHARE], state[at.LAST_SHARE]
    if share == 0.0 and last > 0.0:
        state[at.OWN] = integral - state[at.CARRIED]
        state[at.CARRIED] = 0.0
        integral += state[at.HANDED]
    elif share > last and state[at.CHANGED] > 0.0:
        integral -= (share - last) * full
    elif share > last and full != 0.0:
        if last == 0.0:
            state[at.CARRIED] = integral - state[at.OWN]
        part = state[at.CARRIED] * (share - last) / (1.0 - last)
        state[at.CARRIED] -= part
        integral -= part
    most = c.pid_p[INTEGRAL_LIMIT]
    return float(min(max(integral, -most), most))


@compiled
def stop_at_zero(c: Compensator, state: Floats, row: Floats, header: np.ndarray, rows: Floats) -> float:
    """Write the row of a tick that found a fault: zero volts, whatever the slew limit."""
    c.limit_s[0] = 0.0
    state[at.MODE] = row[at.ROW_STATE] = _FAULT
    row[at.ROW_VOLTAGE] = row[at.ROW_FEEDFORWARD] = row[at.ROW_FEEDBACK] = 0.0
    push(header, rows, row)
    return 0.0


@compiled
def tick_kernel(
    plan: Floats, i: Identifier, c: Compensator, settings: Floats, state: Floats, row: Floats,
    header: np.ndarray, rows: Floats,
) -> float:  # fmt: skip
    """One tick; `row` comes with time, position and timing filled in. Returns the command (V).

    A sample that is not new (status other than 0, or one that was seen before) is no measurement: the axis
    is taken to have moved as the reference did, so that feedback neither kicks nor stops, and nothing is
    learned until enough good samples have come in a row. Before the first good sample nothing goes out.
    """
    position = row[at.ROW_POSITION]
    row[at.ROW_REFERENCE] = plan[at.REFERENCE]
    row[at.ROW_LEARNING] = 0.0
    fresh = row[at.ROW_STATUS] == 0.0
    if fresh and not is_new(state, row):
        row[at.ROW_STATUS] = STALE_STATUS
        fresh = False
    if not fresh and state[at.STARTED] > 0.0:
        position = state[at.X1] + plan[at.REFERENCE] - state[at.LAST_REFERENCE]
    closed = settings[at.CLOSED] > 0.0
    gap = state[at.SINCE] > 0.0
    state[at.FAULT] = check(settings, state, row, header, position, fresh)
    if not math.isfinite(plan[at.REFERENCE]):
        state[at.FAULT] = at.COMMAND
    if state[at.FAULT] != at.OK:
        return stop_at_zero(c, state, row, header, rows)
    if state[at.STARTED] == 0.0:
        if not fresh and closed:
            row[at.ROW_STATE] = state[at.MODE]
            row[at.ROW_VOLTAGE] = row[at.ROW_FEEDFORWARD] = row[at.ROW_FEEDBACK] = 0.0
            push(header, rows, row)
            return 0.0
        state[at.STARTED] = 1.0
        state[at.MODE] = _RUNNING
        settle(i.sections, i.position_memory, position)
        state[at.LEARNED_AT] = position
    if fresh and row[at.ROW_OVERRUN] == 0.0:
        # The commands around the last sample are known to have acted as they were timed.
        if state[at.GOOD] >= 2.0 + settings[at.DELAY]:
            identify(i, c, settings, state, plan[at.KNOWN], plan[at.LEARN], row)
        state[at.GOOD] += 1.0
    else:
        state[at.GOOD] = 0.0
    # Where the device sets the pace, a tick is late when its sample did not come, not when the host was.
    late = (not fresh) if settings[at.DEVICE_PACED] > 0.0 else row[at.ROW_LATENESS] > settings[at.LATE_US]
    keep_pace(state, 1 if late else 0)
    row[at.ROW_STATE] = state[at.MODE]
    state[at.X2] = state[at.X1]
    state[at.X1] = position
    state[at.LAST_REFERENCE] = plan[at.REFERENCE]

    # The compensator's memory follows the reference also while its share is nothing.
    call_basis(i.basis, i.bp.ctypes.data, c.bs.ctypes.data, c.x.ctypes.data, plan[at.LEAD_POSITION])
    lead = 0.0
    for j in range(i.w.size):
        lead += i.w[j] * c.x[j]
    if not abs(lead) < settings[at.FORCE_BOUND]:
        put_aside(i, state)
        degrade(state)
        row[at.ROW_STATE] = state[at.MODE]
    full = plan[at.FEEDFORWARD] * (plan[at.LEAD_FORCE] + lead) / settings[at.FORCE_CONSTANT]
    if closed and c.pid_p[KI] > 0.0:
        c.pid_s[INTEGRAL] = hand_over(c, state, full)
    state[at.LAST_SHARE] = state[at.SHARE]
    if state[at.SHARE] == 1.0:
        state[at.CHANGED] = 0.0
    feedback = plan[at.VOLTS]
    if closed:
        error = plan[at.REFERENCE] - position
        if gap and fresh:  # a derivative across what was not measured would be a kick
            c.pid_s[LAST_INPUT] = -position if c.pid_p[ON_MEASUREMENT] == 1.0 else error
        feedback = pid_step(c.pid_p, c.pid_s, error, position, state[at.EXCESS])
    feedforward = state[at.SHARE] * full if plan[at.FEEDFORWARD] > 0.0 else 0.0
    state[at.HANDED] = feedforward
    asked = (1.0 - plan[at.LET_GO]) * (feedback + feedforward)
    volts = limit_step(c.limit_p, c.limit_s, asked)
    row[at.ROW_FEEDFORWARD] = feedforward
    row[at.ROW_FEEDBACK] = feedback
    if c.limit_s[FLAGS] == NO_NUMBER:
        state[at.FAULT] = at.COMMAND
        return stop_at_zero(c, state, row, header, rows)
    state[at.EXCESS] = volts - asked

    for j in range(int(settings[at.DELAY]) + 1, 0, -1):
        state[at.HISTORY + j] = state[at.HISTORY + j - 1]
    state[at.HISTORY] = volts
    row[at.ROW_VOLTAGE] = volts
    for j in range(i.w.size):
        row[_COLUMNS + j] = i.w[j]
    if i.placing != 0:
        for j in range(i.w.size - 1):
            row[_COLUMNS + i.w.size + j] = 2.0 * i.scales[j]
    push(header, rows, row)
    return volts


@compiled
def lost_kernel(
    plan: Floats, settings: Floats, row: Floats, state: Floats, header: np.ndarray, rows: Floats
) -> None:
    """Account for a slot that was missed altogether: the last command held, the position unknown."""
    row[at.ROW_REFERENCE] = plan[at.REFERENCE]
    row[at.ROW_LEARNING] = 0.0
    lose_slot(settings, state)
    # What came before the gap is no neighbour of what comes after it.
    state[at.GOOD] = 0.0
    state[at.SINCE] += 1.0
    state[at.X1] += plan[at.REFERENCE] - state[at.LAST_REFERENCE]
    state[at.LAST_REFERENCE] = plan[at.REFERENCE]
    row[at.ROW_STATE] = state[at.MODE]
    push(header, rows, row)
