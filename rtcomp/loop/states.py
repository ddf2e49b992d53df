"""The states of the loop and what leads from one to the next. Pure: no device, no clock, no ticks.

    DISCONNECTED - CONNECTED - READY - ARMED - RUNNING <-> DEGRADED - STOPPING
    FAULT: from everywhere but DISCONNECTED, latched; leaves only by an explicit clear

A command other than zero exists in RUNNING and DEGRADED only. FAULT survives closing the device: nothing but
`Step.CLEAR`, which a person asks for, ends it, and then everything begins anew, disarmed, the set-point
where the axis is measured.
"""

from __future__ import annotations

import math
from enum import Enum, IntEnum

from rtcomp.errors import LimitError


class State(IntEnum):
    """Where the loop stands; the numbers stand in the recording's column ``state``."""

    DISCONNECTED = 0
    CONNECTED = 1
    READY = 2
    ARMED = 3
    RUNNING = 4
    DEGRADED = 5
    STOPPING = 6
    FAULT = 7


class Step(Enum):
    """What leads from one state to another."""

    OPEN = "the device is open"
    SAMPLE = "a sample that can be relied on has come"
    LOSE = "samples cannot be relied on any more, nothing is armed"
    ARM = "armed"
    TICK = "the first tick computed a command"
    DEGRADE = "deadlines missed or the identifier put aside: feedforward off"
    RECOVER = "enough ticks in time: feedforward fades back"
    STOP = "the end of the run, or asked to stop"
    ZEROED = "zero volts went out, the device is disarmed"
    FAIL = "a fault"
    CLEAR = "a person has cleared the fault"
    CLOSE = "the device is closed"


_S, _E = State, Step
EDGES: dict[tuple[State, Step], State] = {
    (_S.DISCONNECTED, _E.OPEN): _S.CONNECTED,
    (_S.CONNECTED, _E.SAMPLE): _S.READY,
    (_S.READY, _E.SAMPLE): _S.READY,
    (_S.READY, _E.LOSE): _S.CONNECTED,
    (_S.READY, _E.ARM): _S.ARMED,
    (_S.ARMED, _E.TICK): _S.RUNNING,
    (_S.ARMED, _E.STOP): _S.STOPPING,
    (_S.RUNNING, _E.TICK): _S.RUNNING,
    (_S.RUNNING, _E.DEGRADE): _S.DEGRADED,
    (_S.RUNNING, _E.STOP): _S.STOPPING,
    (_S.DEGRADED, _E.TICK): _S.DEGRADED,
    (_S.DEGRADED, _E.RECOVER): _S.RUNNING,
    (_S.DEGRADED, _E.STOP): _S.STOPPING,
    (_S.STOPPING, _E.ZEROED): _S.CONNECTED,
    (_S.CONNECTED, _E.CLOSE): _S.DISCONNECTED,
    (_S.READY, _E.CLOSE): _S.DISCONNECTED,
    **{
        (state, _E.FAIL): _S.FAULT
        for state in (_S.CONNECTED, _S.READY, _S.ARMED, _S.RUNNING, _S.DEGRADED, _S.STOPPING)
    },
    (_S.FAULT, _E.FAIL): _S.FAULT,
    (_S.FAULT, _E.CLOSE): _S.FAULT,
}
"""Every step that exists. CLEAR is not among them: where it leads depends on whether the device is open."""

DRIVING = frozenset((State.RUNNING, State.DEGRADED))
"""States in which a command other than zero volts may go out."""
HOLDING = frozenset((State.ARMED, State.RUNNING, State.DEGRADED))
"""States in which the set-point is the reference; in all others it is where the axis was measured last."""


class Machine:
    """The state of one loop, and why it is in it.

    `take` makes a step; one that does not exist where the machine stands raises LimitError in one line and
    changes nothing. So nothing is ever armed without a good sample, and nothing leaves FAULT by itself.
    """

    def __init__(self) -> None:
        self.state = State.DISCONNECTED
        self.connected = False
        self.why = ""
        """Of a fault: its line."""
        self.set_point = math.nan
        """m: where the axis is to be. Follows what is measured wherever nothing is driven."""

    def take(self, step: Step, position: float = math.nan, why: str = "") -> State:
        """Make `step` and return the new state; `position` (m) is what was measured, where anything was.

        Raises LimitError for a step that does not exist from here.
        """
        target = self._cleared() if step is Step.CLEAR else EDGES.get((self.state, step))
        if target is None:
            because = f" ({self.why})" if self.state is State.FAULT and self.why else ""
            hint = "; clear the fault first" if self.state is State.FAULT else ""
            raise LimitError(f"no step {step.name} from the state {self.state.name}{because}{hint}")
        if step is Step.FAIL and self.state is not State.FAULT:
            self.why = why  # the first cause; what follows from it is not the cause
        if step is Step.OPEN:
            self.connected = True
        elif step is Step.CLOSE:
            self.connected = False
        elif step is Step.CLEAR:
            self.why = ""
        # Also at arming: it begins where the axis stands, so that arming itself commands nothing.
        if math.isfinite(position) and (self.state not in HOLDING or target not in HOLDING):
            self.set_point = position
        self.state = target
        return target

    @property
    def driving(self) -> bool:
        """Whether a command other than zero may go out."""
        return self.state in DRIVING

    def _cleared(self) -> State | None:
        if self.state is not State.FAULT:
            return None
        return State.CONNECTED if self.connected else State.DISCONNECTED
