"""Run the tick against a device, on a clock, to the end, an error or a signal; always end at zero volts."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import FrameType
from typing import Protocol

import numpy as np

from rtcomp.errors import DeviceError, LimitError
from rtcomp.kernels import Floats
from rtcomp.loop import tick as t
from rtcomp.loop.clock import Clock, VirtualClock
from rtcomp.loop.device import Device, EndOfRun
from rtcomp.loop.ring import Ring
from rtcomp.loop.tick import COLUMNS, Compensator, Identifier, Tick, lost_kernel, tick_kernel

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


class Stop:
    """Set by a signal; looked at once a tick."""

    def __init__(self) -> None:
        self.requested = False
        self.number: int = signal.SIGINT
        """The signal that asked first."""


@contextlib.contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """Turn SIGINT and SIGTERM into a request to stop at the next tick.

    A second one changes nothing: it cannot cut the zeroing short.
    """
    stop = Stop()

    def ask(number: int, _frame: FrameType | None) -> None:
        if not stop.requested:
            stop.number = number
            stop.requested = True

    before = {}
    for number in (signal.SIGINT, signal.SIGTERM):
        # Signals can be handled in the main thread only; elsewhere the caller sets `requested`.
        with contextlib.suppress(ValueError):
            before[number] = signal.signal(number, ask)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


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
) -> Outcome:
    """Open the device, run the plan, command zero, close the device; the ring is told that it is complete.

    `progress(ticks done, newest row)` is called ten times a second, in virtual time only: on a wall clock
    nothing but the loop runs between two deadlines. On a virtual clock the loop waits for a full ring to be
    emptied as long as `recorder_alive()`, on a wall clock never.

    Raises DeviceError where the device fails or reports no number, LimitError where the axis leaves its
    limits; the device has been sent zero volts and closed by then.
    """
    virtual = isinstance(clock, VirtualClock)
    stop = stop or Stop()
    period = float(tick.settings[t.PERIOD])
    row, state, settings = tick.row, tick.state, tick.settings
    header, rows = ring.header, ring.rows
    position, device_time, sequence, status, late_us, spent_us, overrun = (
        COLUMNS.index(name)
        for name in (
            "position",
            "device_time",
            "sequence",
            "status",
            "lateness_us",
            "execution_us",
            "overrun",
        )
    )
    late = lost = done = 0
    seconds = 0.0
    stopped_by = "end"
    ended = 2
    warm_up(tick)
    try:
        # References of 100,000 ticks take tens of milliseconds: between two deadlines that is slots lost.
        first, last = 0, min(BLOCK, plan.ticks) if virtual else plan.ticks
        block = plan.rows(first, last)
        device.open()
        began = time.perf_counter()
        clock.start(period)
        volts = 0.0
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
                row[late_us] = lateness * 1e6
                row[overrun] = 2.0
                for k in range(done, done + missed):
                    row[0] = k * period
                    lost_kernel(block[k - first], row, state, header, rows)
                lost += missed
                done += missed
                lateness -= missed * period
            try:
                sample = device.exchange(volts)
            except EndOfRun:
                stopped_by = "device"
                break
            is_late = lateness > 0.1 * period
            late += is_late
            row[0] = done * period
            row[position] = sample.position
            row[device_time] = sample.time
            row[sequence] = sample.sequence
            row[status] = sample.status
            row[late_us] = lateness * 1e6
            row[spent_us] = state[t.COMPUTED]
            row[overrun] = float(is_late or missed > 0)
            volts = tick_kernel(
                block[done - first], tick.identifier, tick.compensator, settings, state, row, header, rows
            )
            done += 1
            state[t.COMPUTED] = (time.perf_counter_ns() - woken) * 1e-3
            if state[t.FAULT]:
                raise fault(tick, done - 1, sample.position)
            if virtual and not done & 255:
                while recorder_alive is not None and ring.waiting > ring.capacity - 256 and recorder_alive():
                    time.sleep(0.001)
                if progress is not None and time.perf_counter() - shown > 0.1:
                    shown = time.perf_counter()
                    progress(done, row)
        seconds = time.perf_counter() - began
        ended = 1
    finally:
        # Whatever happened: zero volts, then let go; a failure of the one must not keep us from the other.
        try:
            with contextlib.suppress(EndOfRun):
                device.exchange(0.0)
        except DeviceError:
            if ended == 1:
                raise
        finally:
            ring.close(ended)
            device.close()
    return Outcome(done, late, lost, tick.updates, stopped_by, seconds)


def fault(tick: Tick, number: int, position: float) -> Exception:
    """Return the error that says what the check of sample `number` found."""
    s = tick.settings
    at = f"at tick {number} ({number * s[t.PERIOD]:.4g} s)"
    if tick.fault == t.NOT_FINITE:
        return DeviceError(f"the device reported the position {position} {at}; stopped at zero volts")
    if tick.fault == t.TRAVEL:
        return LimitError(
            f"position {position:g} m left the travel [{s[t.TRAVEL_LOW]:g}, {s[t.TRAVEL_HIGH]:g}] m {at}; "
            "stopped at zero volts: check the sign of the feedback, or widen limits.travel"
        )
    return LimitError(
        f"position moved to {position:g} m faster than limits.speed = {s[t.SPEED_LIMIT]:g} m/s {at}; "
        "stopped at zero volts: check the encoder, or raise limits.speed"
    )


def warm_up(tick: Tick) -> None:
    """Compile or load every kernel of the tick before anything is armed, on copies of its arrays."""
    scratch = Ring.create(2, tick.row_width)
    plan = np.zeros(t.PLAN_WIDTH)
    identifier = Identifier(*(a.copy() if isinstance(a, np.ndarray) else a for a in tick.identifier))  # type: ignore[arg-type]
    compensator = Compensator(*(a.copy() for a in tick.compensator))
    state, row = tick.state.copy(), tick.row.copy()
    for k in range(4):
        row[COLUMNS.index("position")] = 1e-9 * k
        tick_kernel(plan, identifier, compensator, tick.settings, state, row, scratch.header, scratch.rows)
    lost_kernel(plan, row, state, scratch.header, scratch.rows)
    scratch.release()
