"""What missed deadlines do: counted, degraded, a fault (notes of the decision in docs/decisions).

One late tick takes one nominal period, is not caught up, and teaches nothing. Three late in a row, eight of
32, or a slot missed altogether: DEGRADED, feedforward off, feedback on, until 32 ticks in time. Twenty slots
lost, in one go or more than one in a hundred for long: a fault.
"""

from __future__ import annotations

from rtcomp.kernels import Floats, compiled
from rtcomp.loop.layout import (
    CHANGED,
    CLEAN,
    CLEAN_TICKS,
    DEGRADED_TIMES,
    FADE,
    FADE_ANEW,
    FAULT,
    FORGIVE,
    HELD,
    LATE_BITS,
    LATE_IN_ROW,
    LATE_OF,
    LATE_RUN,
    LATE_SUM,
    LOST,
    MODE,
    OVERRUN,
    SHARE,
    SLOTS_LOST,
    WINDOW,
)
from rtcomp.loop.states import State

RUNNING, DEGRADED, FAULTY = float(State.RUNNING), float(State.DEGRADED), float(State.FAULT)
_MASK = (1 << WINDOW) - 1


@compiled
def note(state: Floats, late: int) -> None:
    """Count one slot, `late` (1) or in time (0): those in a row, those among the last `WINDOW`."""
    bits = int(state[LATE_BITS])
    state[LATE_SUM] += late - ((bits >> (WINDOW - 1)) & 1)
    state[LATE_BITS] = ((bits << 1) | late) & _MASK
    if late:
        state[LATE_RUN] += 1.0
        state[CLEAN] = 0.0
    else:
        state[LATE_RUN] = 0.0
        state[CLEAN] += 1.0
        state[LOST] = max(0.0, state[LOST] - FORGIVE)


@compiled
def degrade(state: Floats) -> None:
    """Turn feedforward off; feedback goes on."""
    if state[MODE] == RUNNING:
        state[MODE] = DEGRADED
        state[DEGRADED_TIMES] += 1.0
        state[SHARE] = 0.0


@compiled
def keep_pace(state: Floats, late: int) -> None:
    """Account for a tick that was served: degrade, recover, let feedforward fade back."""
    note(state, late)
    if state[LATE_RUN] >= LATE_IN_ROW or state[LATE_SUM] >= LATE_OF or state[HELD] > 0.0:
        degrade(state)
    if state[HELD] > 0.0:
        state[HELD] -= 1.0
    elif state[MODE] == DEGRADED and state[CLEAN] >= CLEAN_TICKS:
        state[MODE] = RUNNING
    if state[MODE] == RUNNING and state[SHARE] < 1.0:
        state[SHARE] = min(1.0, state[SHARE] + (FADE_ANEW if state[CHANGED] > 0.0 else FADE))


@compiled
def lose_slot(settings: Floats, state: Floats) -> None:
    """Account for a slot that was missed altogether; too many are a fault."""
    note(state, 1)
    degrade(state)
    state[LOST] += 1.0
    if state[LOST] >= settings[SLOTS_LOST]:
        state[FAULT] = OVERRUN
        state[MODE] = FAULTY
