"""The tick: read, check, identify, compensate, limit, write, hand over to the ring. Once, for every clock.

Its arithmetic is one compiled kernel on preallocated arrays; nothing is allocated while it runs. What
changes from tick to tick without depending on the measurement (references, forces known beforehand, when to
learn, how much feedforward) comes from a plan: a table with one row a tick.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rtcomp.control.limits import limit_step
from rtcomp.control.pid import pid_step
from rtcomp.hysteresis.basis import Basis
from rtcomp.hysteresis.conditioning import memory, settle, smooth
from rtcomp.hysteresis.learner import Learner
from rtcomp.kernels import Floats, call_basis, call_learner, compiled
from rtcomp.loop.push import push

REFERENCE, LEAD_POSITION, LEAD_FORCE, KNOWN, FEEDFORWARD, LEARN, VOLTS = range(7)
"""Columns of a plan. Reference at the tick (m); reference where the command will act (m); force needed
there but for hysteresis (N); forces known to have acted around the tick before, other than inertia and
viscous friction (N); share of feedforward (0 to 1); whether to learn (0 or 1); command in open loop (V)."""
PLAN_WIDTH = 7

COLUMNS = (
    "time", "reference", "position", "voltage", "force", "force_model", "feedforward", "feedback",
    "device_time", "sequence", "status", "lateness_us", "execution_us", "overrun", "learning",
)  # fmt: skip
"""What the tick writes into the ring, then the weights and the offset."""
(
    _TIME, _REFERENCE, _POSITION, _VOLTAGE, _FORCE, _FORCE_MODEL, _FEEDFORWARD, _FEEDBACK, _DEVICE_TIME,
    _SEQUENCE, _STATUS, _LATENESS, _EXECUTION, _OVERRUN, _LEARNING,
) = range(len(COLUMNS))  # fmt: skip

OK, NOT_FINITE, TRAVEL, SPEED = 0, 1, 2, 3
"""What the check of a sample may find: nothing, a position that is no number, one outside the travel,
one that moved faster than the axis may."""

(
    PERIOD,
    FORCE_CONSTANT,
    MASS,
    VISCOUS,
    GATE,
    TRAVEL_LOW,
    TRAVEL_HIGH,
    SPEED_LIMIT,
    DELAY,
    OFFSET_SCALE,
    CLOSED,
) = range(11)
"""Settings: s, N/V, kg, N s/m, m, m, m, m/s, ticks, m (regressor of the offset), 1 for closed loop."""

(
    GOOD,
    X1,
    X2,
    LAST_REFERENCE,
    LEARNED_AT,
    EXCESS,
    FAULT,
    COMPUTED,
    UPDATES,
    STARTED,
    MEASURED,
    HISTORY,
) = range(12)
"""State: good samples in a row until now; positions one and two ticks ago (m); reference one tick ago (m);
position at the last update (m); what the limits cut from the last command (V); what the check found;
execution time of the last tick (us); updates of the weights; whether there was a sample; whether the position
one tick ago was measured, if only late; from here on the commands of the last ticks, newest first (V)."""


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


class Compensator(NamedTuple):
    """The compensating half: the same basis with a state of its own, driven by the reference; PID; limits."""

    bs: Floats
    x: Floats
    pid_p: Floats
    pid_s: Floats
    limit_p: Floats
    limit_s: Floats


@compiled
def identify(i: Identifier, settings: Floats, state: Floats, known: float, learn: float, row: Floats) -> None:
    """Feed the measurement of one tick ago, whose force is known by now, to the basis and the learner.

    The command is constant between ticks, so the force around a sample is the mean of the commands before
    and after it, and the acceleration that belongs to it is the second difference of position.
    """
    period, delay = settings[PERIOD], int(settings[DELAY])
    x0, x1, x2 = row[_POSITION], state[X1], state[X2]
    volts = 0.5 * (state[HISTORY + delay] + state[HISTORY + delay + 1])
    force = settings[FORCE_CONSTANT] * volts - known
    force -= settings[MASS] * (x0 - 2.0 * x1 + x2) / (period * period)
    force -= settings[VISCOUS] * (x0 - x2) / (2.0 * period)
    position = smooth(i.sections, i.position_memory, x1)
    force = smooth(i.sections, i.force_memory, force)
    call_basis(i.basis, i.bp.ctypes.data, i.bs.ctypes.data, i.x.ctypes.data, position)
    model = 0.0
    for j in range(i.w.size):
        model += i.w[j] * i.x[j]
    row[_FORCE] = force
    row[_FORCE_MODEL] = model
    error = force - model
    if learn > 0.0 and abs(position - state[LEARNED_AT]) >= settings[GATE] and math.isfinite(error):
        state[LEARNED_AT] = position
        state[UPDATES] += 1.0
        call_learner(i.learner, i.lp.ctypes.data, i.ls.ctypes.data, i.x.ctypes.data, i.w.ctypes.data, error)
        row[_LEARNING] = 1.0


@compiled
def tick_kernel(
    plan: Floats, i: Identifier, c: Compensator, settings: Floats, state: Floats, row: Floats,
    header: np.ndarray, rows: Floats,
) -> float:  # fmt: skip
    """One tick; `row` comes with time, position and timing filled in. Returns the command (V).

    A sample that is not new (status other than 0) is no measurement: the axis is taken to have moved as
    the reference did, so that feedback neither kicks nor stops, and nothing is learned until enough good
    samples have come in a row.
    """
    position = row[_POSITION]
    row[_REFERENCE] = plan[REFERENCE]
    row[_LEARNING] = 0.0
    fresh = row[_STATUS] == 0.0
    if not fresh and state[STARTED] > 0.0:
        position = state[X1] + plan[REFERENCE] - state[LAST_REFERENCE]
    state[FAULT] = OK
    if not math.isfinite(position):
        state[FAULT] = NOT_FINITE
    elif position < settings[TRAVEL_LOW] or position > settings[TRAVEL_HIGH]:
        state[FAULT] = TRAVEL
    elif fresh and state[MEASURED] > 0.0:
        # Two samples of which one is late are up to two periods apart.
        periods = 1.0 if state[GOOD] > 0.0 and row[_OVERRUN] == 0.0 else 2.0
        if abs(position - state[X1]) > settings[SPEED_LIMIT] * settings[PERIOD] * periods:
            state[FAULT] = SPEED
    if state[FAULT] != OK:
        c.limit_s[0] = 0.0
        row[_VOLTAGE] = row[_FEEDFORWARD] = row[_FEEDBACK] = 0.0
        push(header, rows, row)
        return 0.0

    if state[STARTED] == 0.0:
        state[STARTED] = 1.0
        settle(i.sections, i.position_memory, position)
        state[LEARNED_AT] = position
    if fresh and row[_OVERRUN] == 0.0:
        # The commands around the last sample are known to have acted as they were timed.
        if state[GOOD] >= 2.0 + settings[DELAY]:
            identify(i, settings, state, plan[KNOWN], plan[LEARN], row)
        state[GOOD] += 1.0
    else:
        state[GOOD] = 0.0
    state[MEASURED] = 1.0 if fresh else 0.0
    state[X2] = state[X1]
    state[X1] = position
    state[LAST_REFERENCE] = plan[REFERENCE]

    feedback = plan[VOLTS]
    if settings[CLOSED] > 0.0:
        feedback = pid_step(c.pid_p, c.pid_s, plan[REFERENCE] - position, position, state[EXCESS])
    # The compensator's memory follows the reference also while its share is nothing.
    call_basis(i.basis, i.bp.ctypes.data, c.bs.ctypes.data, c.x.ctypes.data, plan[LEAD_POSITION])
    feedforward = 0.0
    if plan[FEEDFORWARD] > 0.0:
        force = plan[LEAD_FORCE]
        for j in range(i.w.size):
            force += i.w[j] * c.x[j]
        feedforward = plan[FEEDFORWARD] * force / settings[FORCE_CONSTANT]
    asked = feedback + feedforward
    volts = limit_step(c.limit_p, c.limit_s, asked)
    state[EXCESS] = volts - asked

    for j in range(int(settings[DELAY]) + 1, 0, -1):
        state[HISTORY + j] = state[HISTORY + j - 1]
    state[HISTORY] = volts
    row[_VOLTAGE] = volts
    row[_FEEDFORWARD] = feedforward
    row[_FEEDBACK] = feedback
    for j in range(i.w.size):
        row[len(COLUMNS) + j] = i.w[j]
    push(header, rows, row)
    return volts


@compiled
def lost_kernel(plan: Floats, row: Floats, state: Floats, header: np.ndarray, rows: Floats) -> None:
    """Account for a slot that was missed altogether: the last command held, the position unknown."""
    row[_REFERENCE] = plan[REFERENCE]
    row[_LEARNING] = 0.0
    # What came before the gap is no neighbour of what comes after it.
    state[GOOD] = 0.0
    state[MEASURED] = 0.0
    state[X1] += plan[REFERENCE] - state[LAST_REFERENCE]
    state[LAST_REFERENCE] = plan[REFERENCE]
    push(header, rows, row)


class TickSettings(NamedTuple):
    """What a tick needs to know of the axis and of how to learn. SI units."""

    period: float
    force_constant: float
    mass: float = 0.0
    viscous: float = 0.0
    gate: float = 0.0
    travel: tuple[float, float] = (-math.inf, math.inf)
    speed: float = math.inf
    delay_ticks: int = 0
    closed_loop: bool = True


class Tick:
    """All arrays of one loop, allocated beforehand; calling it runs the kernel on one sample.

    `weights` (size of basis + 1, the last the offset in N per m of the mean width) are taken as a start;
    `sections` are the conditioning filter's (hysteresis.conditioning.low_pass).
    """

    def __init__(
        self,
        settings: TickSettings,
        basis: Basis,
        learner: Learner,
        *,
        sections: Floats,
        pid: tuple[Floats, Floats],
        limits: tuple[Floats, Floats],
        weights: Floats | None = None,
        learn_offset: bool = True,
    ) -> None:
        n = basis.size
        scales = basis.scales()
        offset_scale = float(scales.mean()) if learn_offset else 0.0
        all_scales = np.append(scales, offset_scale if learn_offset else float(scales.mean()))
        self.columns: Sequence[str] = COLUMNS
        self.weights: Floats = np.zeros(n + 1)
        if weights is not None:
            self.weights[:] = weights
        self.offset_scale = offset_scale
        self.basis, self.learner, self.scales = basis, learner, all_scales
        x, lead_x = np.zeros(n + 1), np.zeros(n + 1)
        x[n] = lead_x[n] = offset_scale
        self.identifier = Identifier(
            basis.kernel.address, basis.vector(), basis.initial_state(), x,
            learner.kernel.address, learner.vector(all_scales), learner.initial_state(all_scales),
            self.weights, sections, memory(sections), memory(sections),
        )  # fmt: skip
        self.compensator = Compensator(basis.initial_state(), lead_x, *pid, *limits)
        s = settings
        self.settings: Floats = np.array(
            [
                s.period, s.force_constant, s.mass, s.viscous, s.gate, s.travel[0], s.travel[1], s.speed,
                s.delay_ticks, offset_scale, float(s.closed_loop),
            ]
        )  # fmt: skip
        self.state: Floats = np.zeros(HISTORY + s.delay_ticks + 3)
        self.row: Floats = np.zeros(len(COLUMNS) + n + 1)

    @property
    def row_width(self) -> int:
        """Numbers in a row of the ring: the columns, the weights, the offset."""
        return int(self.row.size)

    @property
    def delay_ticks(self) -> int:
        """Ticks until a command takes effect, as the identifier assumes."""
        return int(self.settings[DELAY])

    @property
    def closed_loop(self) -> bool:
        """Whether feedback runs; otherwise the plan's voltages go out."""
        return bool(self.settings[CLOSED])

    @property
    def fault(self) -> int:
        """What the check of the last sample found."""
        return int(self.state[FAULT])

    @property
    def updates(self) -> int:
        """How often the weights were changed."""
        return int(self.state[UPDATES])
