"""Run the tick against a device, on a clock, to the end, an error or a signal; always end at zero volts."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rtcomp.errors import DeviceError, EmergencyStopError, LimitError, RtcompError
from rtcomp.interrupts import Stop
from rtcomp.kernels import Floats
from rtcomp.loop import layout as at
from rtcomp.loop.bound import BoundTick
from rtcomp.loop.clock import Clock, VirtualClock
from rtcomp.loop.device import OK, Armable, Device, EndOfRun
from rtcomp.loop.ring import STOPPED, Ring
from rtcomp.loop.states import HOLDING, Machine, State, Step
from rtcomp.loop.tick import Compensator, Identifier, Tick, lost_kernel
from rtcomp.loop.trips import STOPPED_BY, trip

BLOCK = 100_000
"""Rows of a plan asked for at a time in virtual time; on a wall clock all of them are there before tick 0."""


class Plan(Protocol):
    """Where the rows of the tick's table come from."""

    @property
    def ticks(self) -> int:
        """Length of the run."""

    def rows(self, first: int, count: int) -> Floats:
        """Return rows `first` to `first + count`, shape (count, PLAN_WIDTH)."""


@dataclass(frozen=True)
class Outcome:
    """How a run went."""

    ticks: int
    """Rows handed over to the ring, lost slots among them."""
    late: int
    """Ticks that began more than a tenth of a period late."""
    lost: int
    """Slots missed altogether."""
    updates: int
    """Changes of the weights."""
    stopped_by: str
    """``end``, ``signal`` or ``device`` (a recording that ended)."""
    seconds: float
    """Wall time of the loop."""
    degraded: int = 0
    """Times that feedforward went off for missed deadlines or a diverged identifier."""
    diverged: int = 0
    """Times that the identifier diverged and was taken back to what it had kept."""
    repeated: int = 0
    """Samples that called themselves new and were not."""
    taken_back: int = 0
    """Times that learning had spoiled the weights, and those kept were taken."""


def _lose(tick: Tick, ring: Ring, first: int, references: Floats) -> None:
    """Record the slots from tick `first` on that passed unseen, one for each of `references`.

    Raises LimitError where they are more than may be lost.
    """
    tick.row[at.ROW_OVERRUN] = 2.0
    for k, reference in enumerate(references, first):
        tick.row[0] = k * float(tick.settings[at.PERIOD])
        lost_kernel(reference, tick.settings, tick.row, tick.state, ring.header, ring.rows)
    if tick.state[at.FAULT]:
        raise trip(tick, first + len(references) - 1, float(tick.state[at.X1]))


def _zero(device: Device, machine: Machine, *, untouched: bool) -> None:
    """Send zero volts, unless the device is `untouched`; raise OSError where they did not arrive."""
    with contextlib.suppress(EndOfRun):
        if not untouched:
            device.exchange(0.0)
    if machine.state is State.STOPPING:
        machine.take(Step.ZEROED)


def _let_empty(ring: Ring, recorder_alive: Callable[[], bool] | None) -> None:
    """Wait until a full ring has been emptied, as long as somebody does so."""
    while recorder_alive is not None and ring.waiting > ring.capacity - 256 and recorder_alive():
        time.sleep(0.001)


def run(
    device: Device,
    tick: Tick,
    plan: Plan,
    clock: Clock,
    ring: Ring,
    *,
    stop: Stop | None = None,
    progress: Callable[[int, Floats], None] | None = None,
    recorder_alive: Callable[[], bool] | None = None,
    machine: Machine | None = None,
    tell: Callable[[float, int, str], None] | None = None,
    spare_stand_ins: bool = False,
) -> Outcome:
    """Open the device, run the plan, command zero, close the device; the ring is told that it is complete.

    `progress(ticks done, newest row)` is called ten times a second, in virtual time only: on a wall clock
    nothing but the loop runs between two deadlines. On a virtual clock the loop waits for a full ring to be
    emptied as long as `recorder_alive()`, on a wall clock never.

    `machine` is the state of the loop, followed through all of it. `tell(time (s), state, line)` is told why
    it ended, before the ring is closed. With `spare_stand_ins` lost slots are only counted, never a fault,
    on a device that says it is no hardware: nothing can be hurt there, and machines of tests are busy.

    Raises DeviceError where the device fails or reports what cannot be, LimitError where the axis leaves its
    limits or the command is no number, EmergencyStopError; the device has been sent zero volts and closed by
    then.
    """
    virtual = isinstance(clock, VirtualClock)
    stop = stop or Stop()
    machine = machine or Machine()
    period = float(tick.settings[at.PERIOD])
    row, state, settings = tick.row, tick.state, tick.settings
    header, rows = ring.header, ring.rows
    late = lost = done = 0
    seconds = 0.0
    stopped_by = "end"
    ended = 2
    # What was only looked at is at zero and is not armed, not even to be told so.
    untouched = isinstance(device, Armable)
    warm_up(tick)
    bound = BoundTick(tick.identifier, tick.compensator, settings, state, row, header, rows)
    try:
        # References of 100,000 ticks take tens of milliseconds: between two deadlines that is slots lost.
        first, last = 0, min(BLOCK, plan.ticks) if virtual else plan.ticks
        block = plan.rows(first, last)
        connect(device, machine, tick, int(header[STOPPED]))
        if spare_stand_ins and not getattr(device, "hardware", True):
            settings[at.SLOTS_LOST] = np.inf
        untouched = False
        began = time.perf_counter()
        clock.start(period)
        volts = 0.0
        mode = state[at.MODE]
        shown = began
        while done < plan.ticks:
            if done == last:
                first, last = done, min(done + BLOCK, plan.ticks)
                block = plan.rows(first, last - first)
            lateness = clock.wait(done)
            woken = time.perf_counter_ns()
            if stop.requested:
                stopped_by = "signal"
                break
            missed = 0
            if lateness >= period:
                missed = min(int(lateness / period), last - 1 - done)
                row[at.ROW_LATENESS] = lateness * 1e6
                lost += missed
                done += missed
                _lose(tick, ring, done - missed, block[done - missed - first : done - first])
                lateness -= missed * period
            try:
                sample = device.exchange(volts)
            except EndOfRun:
                stopped_by = "device"
                break
            is_late = lateness > 0.1 * period
            late += is_late
            row[0] = done * period
            row[at.ROW_POSITION] = sample.position
            row[at.ROW_DEVICE_TIME] = sample.time
            row[at.ROW_SEQUENCE] = sample.sequence
            row[at.ROW_STATUS] = sample.status
            row[at.ROW_LATENESS] = lateness * 1e6
            row[at.ROW_EXECUTION] = state[at.COMPUTED]
            row[at.ROW_OVERRUN] = float(is_late or missed > 0)
            volts = bound(block[done - first])
            done += 1
            state[at.COMPUTED] = (time.perf_counter_ns() - woken) * 1e-3
            if state[at.MODE] != mode:
                mode = state[at.MODE]
                if mode == State.FAULT:
                    raise trip(tick, done - 1, sample.position, int(header[STOPPED]))
                follow(machine, State(int(mode)), sample.position)
            if virtual and not done & 255:
                _let_empty(ring, recorder_alive)
                if progress is not None and time.perf_counter() - shown > 0.1:
                    shown = time.perf_counter()
                    progress(done, row)
        seconds = time.perf_counter() - began
        ended = 1
        if machine.state in HOLDING:
            machine.take(Step.STOP)
    except RtcompError as error:
        fail(machine, str(error))
        raise
    except OSError as error:  # a driver's own, of a port that has gone
        fail(machine, str(error))
        raise DeviceError(f"the device has gone at tick {done}: {error}; check cable and power") from error
    except BaseException as error:
        fail(machine, f"{type(error).__name__}: {error}")
        raise
    finally:
        # Whatever happened: zero volts, then let go; a failure of the one must not keep us from the other.
        try:
            _zero(device, machine, untouched=untouched)
        except OSError:
            if ended == 1:
                fail(machine, "zero volts did not arrive")
                raise
        finally:
            if tell is not None:
                why = machine.why if machine.state is State.FAULT else f"ended by {stopped_by}"
                tell(done * period, int(machine.state), why)
            ring.close(ended)
            device.close()
            if machine.connected:
                machine.take(Step.CLOSE)
    counts = (int(state[place]) for place in (at.DEGRADED_TIMES, at.DIVERGED, at.REPEATED, at.TAKEN_BACK))
    return Outcome(done, late, lost, tick.updates, stopped_by, seconds, *counts)


def connect(device: Device, machine: Machine, tick: Tick, stopped: int) -> None:
    """Open the device and, where it can be looked at first, arm it if what is seen is in order.

    Raises DeviceError or LimitError where it is not, EmergencyStopError where an emergency stop is asked for;
    nothing is armed then.
    """
    device.open()
    machine.take(Step.OPEN)
    if stopped:
        by = STOPPED_BY.get(stopped, "another process")
        raise EmergencyStopError(f"emergency stop by {by}: nothing was armed; release it, then start again")
    if not isinstance(device, Armable):
        return  # its first exchange, at zero volts, is the look
    sample = device.look()
    low, high = tick.settings[at.TRAVEL_LOW], tick.settings[at.TRAVEL_HIGH]
    if sample.status != OK or not np.isfinite(sample.position):
        raise DeviceError(
            f"the device has no position that can be used ({sample.position:g} m, status {sample.status}); "
            "nothing was armed: check the sensor, home the axis"
        )
    if not low <= sample.position <= high:
        raise LimitError(
            f"the axis stands at {sample.position:g} m, outside the travel [{low:g}, {high:g}] m; nothing "
            "was armed: move it, or change limits.travel"
        )
    machine.take(Step.SAMPLE, sample.position)
    device.arm()
    machine.take(Step.ARM, sample.position)
    tick.state[at.MODE] = State.ARMED


def follow(machine: Machine, mode: State, position: float) -> None:
    """Let the machine make the steps that the tick has made."""
    if machine.state is State.CONNECTED:
        machine.take(Step.SAMPLE, position)
        machine.take(Step.ARM, position)
    if machine.state is State.ARMED:
        machine.take(Step.TICK)
    if mode is not machine.state:
        machine.take(Step.DEGRADE if mode is State.DEGRADED else Step.RECOVER)


def fail(machine: Machine, why: str) -> None:
    """Latch a fault, if there is anything to be at fault."""
    if machine.state is not State.DISCONNECTED:
        machine.take(Step.FAIL, why=why)


def warm_up(tick: Tick) -> None:
    """Compile or load every kernel of the tick before anything is armed, on copies of its arrays."""
    scratch = Ring.create(2, tick.row_width)
    plan = np.zeros(at.PLAN_WIDTH)
    identifier = Identifier(*(a.copy() if isinstance(a, np.ndarray) else a for a in tick.identifier))  # type: ignore[arg-type]
    compensator = Compensator(*(a.copy() for a in tick.compensator))
    state, row = tick.state.copy(), tick.row.copy()
    bound = BoundTick(identifier, compensator, tick.settings, state, row, scratch.header, scratch.rows)
    for k in range(4):
        row[at.ROW_POSITION] = 1e-9 * k
        row[at.ROW_SEQUENCE] = k + 1.0
        bound(plan)
    lost_kernel(plan, tick.settings, row, state, scratch.header, scratch.rows)
    scratch.release()
