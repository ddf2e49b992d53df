"""A small stage, a device that notes what is done to it, a clock that is late on purpose, a loop of them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.simulated import SimulatedDriver, SimulatedSettings

from rtcomp.control.limits import limit_state, limit_vector
from rtcomp.control.pid import pid_state, pid_vector
from rtcomp.errors import DeviceError
from rtcomp.hysteresis.conditioning import low_pass
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.rls import Rls
from rtcomp.loop.clock import VirtualClock
from rtcomp.loop.ring import Ring
from rtcomp.loop.run import run
from rtcomp.loop.tick import (
    COLUMNS,
    FEEDFORWARD,
    LEAD_FORCE,
    LEAD_POSITION,
    LEARN,
    PLAN_WIDTH,
    REFERENCE,
    VOLTS,
    Tick,
    TickSettings,
)
from rtcomp.stage.stage import Stage

WIDTHS = [4e-6, 8e-6, 1.6e-5, 2.4e-5]
WEIGHTS = [3.2e5, 1.6e5, 8e4, 3e4]
MASS, CONSTANT, VISCOUS = 2.0, 4.0, 8.0
GAINS = (2e4, 2e5, 100.0)
TICKS = 400
"""Of most runs."""
AT = 250
"""The tick at which something goes wrong in them."""


def stage(rate=1000.0, noise=0.0):
    """Friction that an interval model of these widths has exactly these weights for."""
    return Stage.from_dict(
        {
            "stage": {
                "mass": MASS, "force_constant": CONSTANT, "voltage_limit": 10.0, "viscous": VISCOUS,
                "friction": {"model": "interval", "widths": WIDTHS, "weights": WEIGHTS},
            },
            "sensor": {"noise": noise},
            "rate": rate,
        }
    )  # fmt: skip


@dataclass
class NotingDevice:
    """The simulated stage, with notes of every call; goes wrong at an exchange when it is told."""

    inner: SimulatedDriver
    wrong: dict[int, object] = field(default_factory=dict)
    """Exchange number: an exception to raise, or a function of the sample."""
    gone: bool = False
    calls: list[tuple[str, float]] = field(default_factory=list)
    exchanges: int = 0

    @property
    def delay_ticks(self):
        return self.inner.delay_ticks

    def open(self):
        self.calls.append(("open", 0.0))
        self.inner.open()

    def exchange(self, volts):
        self.calls.append(("exchange", volts))
        number, self.exchanges = self.exchanges, self.exchanges + 1
        if self.gone:
            raise DeviceError("the test's device has gone")
        what = self.wrong.get(number)
        if isinstance(what, Exception):
            raise what
        sample = self.inner.exchange(volts)
        return what(sample) if callable(what) else sample

    def close(self):
        self.calls.append(("close", 0.0))
        self.inner.close()

    @property
    def commands(self):
        return [v for name, v in self.calls if name == "exchange"]


def device(the_stage, delay=0, seed=0, **wrong):
    bench = Bench(stage=the_stage, period=1.0 / the_stage.rate, seed=seed)
    return NotingDevice(
        SimulatedDriver(SimulatedSettings(driver="simulated", delay_ticks=delay), bench), **wrong
    )


@dataclass
class TablePlan:
    """A plan that is a table."""

    table: np.ndarray

    @property
    def ticks(self):
        return len(self.table)

    def rows(self, first, count):
        return self.table[first : first + count].copy()


def wave(ticks, period, amplitude=6e-5):
    """Two sines through presliding and sliding: position, velocity, acceleration, beginning at rest."""
    t = period * np.arange(ticks)

    def at(t):
        fade = np.clip(t / 0.2, 0.0, 1.0) ** 2 * (3 - 2 * np.clip(t / 0.2, 0.0, 1.0))
        return fade * amplitude * (np.sin(2 * np.pi * 1.3 * t) + 0.4 * np.sin(2 * np.pi * 4.1 * t))

    d = 1e-5
    return at(t), (at(t + d) - at(t - d)) / (2 * d), (at(t + d) - 2 * at(t) + at(t - d)) / d**2


def plan(ticks, period=1e-3, learn=True, share=0.0, volts=0.0):
    table = np.zeros((ticks, PLAN_WIDTH))
    x, v, a = wave(ticks, period)
    table[:, REFERENCE] = table[:, LEAD_POSITION] = x
    table[:, LEAD_FORCE] = MASS * a + VISCOUS * v
    table[:, LEARN] = learn
    table[:, FEEDFORWARD] = share
    table[:, VOLTS] = volts
    return TablePlan(table)


def tick(
    period=1e-3,
    delay=0,
    smoothing=0.0,
    gate=0.0,
    weights=None,
    closed_loop=True,
    learner=None,
    offset=True,
    **limits,
):
    return Tick(
        TickSettings(
            period=period, force_constant=CONSTANT, mass=MASS, viscous=VISCOUS, gate=gate,
            delay_ticks=delay, closed_loop=closed_loop, **limits,
        ),
        IntervalBasis(WIDTHS),
        learner or Rls(1.0),
        sections=low_pass(smoothing, 1.0 / period),
        pid=(pid_vector(*GAINS, period=period, voltage_limit=10.0), pid_state()),
        limits=(limit_vector(10.0, period), limit_state()),
        weights=weights,
        learn_offset=offset,
    )  # fmt: skip


class LateClock:
    """A clock that wakes late by what it is told: seconds by tick; does not sleep."""

    def __init__(self, late):
        self.late = dict(late)
        self.asked = []

    def start(self, period):
        self.period = period
        self.ahead = 0.0

    def wait(self, tick_number):
        """Lateness that is not told decays: what was missed is made up for, as on a wall clock."""
        self.asked.append(tick_number)
        return self.late.get(tick_number, 0.0)


@dataclass
class Left:
    """What a run left behind."""

    outcome: object
    ring: Ring
    rows: np.ndarray
    device: NotingDevice
    tick: Tick

    def column(self, name):
        return self.rows[:, COLUMNS.index(name)]

    @property
    def weights(self):
        return self.rows[:, len(COLUMNS) :]


def go(the_device, the_tick, the_plan, clock=None, error=None, **options):
    """Run; with `error`, expect it. The ring is taken whole."""
    ring = Ring.create(max(the_plan.ticks, 1) + 8, the_tick.row_width)
    outcome = None
    try:
        outcome = run(the_device, the_tick, the_plan, clock or VirtualClock(), ring, **options)
        assert error is None, "the run ended well"
    except Exception as caught:
        if error is None or not isinstance(caught, error):
            raise
        outcome = caught
    rows = ring.take()
    ring.release()
    return Left(outcome, ring, rows, the_device, the_tick)


def ended_safely(left):
    names = [name for name, _ in left.device.calls]
    assert names[0] == "open" and names[-1] == "close" and names.count("close") == 1
    assert left.device.commands[-1] == 0.0
    assert names[-2] == "exchange"
    assert max(abs(v) for v in left.device.commands) > 0.5  # it did drive before
    assert np.array_equal(left.column("time"), 1e-3 * np.arange(len(left.rows)))


def replaced(**change):
    """Have an exchange's sample changed: what a `NotingDevice` takes."""
    return lambda sample: sample._replace(**change)
