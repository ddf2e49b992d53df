"""One run of a row of the table of faults on a stage, and whether it came as the row requires.

Everything in virtual time on the simulated Leuven stage, identifying and compensating; what counts is what
the plant's side saw: the volts by which the simulation was advanced.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from fault_rows import AGE, JUMP, LOST, ROWS, Bed, Draw, Row
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.faults import Fault, FaultyClock, FaultyDevice
from rtcomp_drivers.simulated import SimulatedDriver, SimulatedSettings

from rtcomp.errors import RtcompError
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import ALWAYS
from rtcomp.jobs.plan import ReferencePlan
from rtcomp.jobs.session import make_tick
from rtcomp.loop.clock import VirtualClock
from rtcomp.loop.ring import Ring
from rtcomp.loop.run import Outcome, Stop, run
from rtcomp.loop.states import Machine, State
from rtcomp.loop.tick import COLUMNS

TICKS = 1400
DRIVEN = 2.0
"""V at which the axis must move (friction is 1.2 V)."""


class Plant(SimulatedDriver):
    """The simulated stage, with a note of every voltage that it was advanced by."""

    def __init__(self, settings: SimulatedSettings, bench: Bench) -> None:
        super().__init__(settings, bench)
        self.volts: list[float] = []

    def open(self) -> None:
        """Open, and begin to take notes."""
        super().open()
        advance = self.simulator.advance

        def noting(volts: float, seconds: float) -> None:
            self.volts.append(volts)
            advance(volts, seconds)

        self.simulator.advance = noting  # type: ignore[method-assign]


@dataclass
class Variant:
    """One run of a row: what came of it."""

    reaction: int
    """Ticks from the fault until the plant had zero volts, for good; -1 where the run went on."""
    problems: list[str] = field(default_factory=list)


def configuration() -> Configuration:
    config = Configuration.load(shipped("leuven.yaml"))
    limits = {
        "travel": [-1e-3, 1e-3], "speed": 0.05, "jump": JUMP, "age": 1e-3 * AGE, "stuck": 0.05,
        "voltage": 4.0, "moves_at": DRIVEN,
    }  # fmt: skip
    moving = {"kind": "multisine", "frequencies": [2.0, 5.3], "amplitudes": [1.2e-4, 4e-5], "duration": 2.0}
    return config.changed(limits=limits, reference=moving, loop={"slots_lost": LOST})


def believed(config: Configuration) -> HysteresisModel:
    """The model that the stage's own stop elements are."""
    elements = config.stage.to_dict()["stage"]["friction"]
    reaches = np.array([e["reach"] for e in elements])
    weights = np.cumsum([e["stiffness"] for e in elements][::-1])[::-1]
    return HysteresisModel(IntervalBasis(np.diff(2.0 * reaches, prepend=0.0)), weights.copy())


class TablePlan:
    """The plan of a run as a table, so that a row can be spoilt."""

    def __init__(self, table: np.ndarray) -> None:
        self.table = table

    @property
    def ticks(self) -> int:
        """Length of the run."""
        return len(self.table)

    def rows(self, first: int, count: int) -> np.ndarray:
        """Rows `first` to `first + count`."""
        return self.table[first : first + count].copy()


CONFIG = configuration()
MODEL = believed(CONFIG)
REFERENCE = CONFIG.reference()
TABLES = [
    ReferencePlan(REFERENCE, CONFIG.stage, CONFIG.period, TICKS, delay, ALWAYS, 0.0).rows(0, TICKS)
    for delay in (0, 1)
]


def beside(row: Row, draw: Draw, begin: int) -> tuple[list[Fault], int]:
    """Half of the variants have something harmless besides: before, or, where a run is to end, also with it.

    Returns it, and for how many ticks it may hide the fault.
    """
    if draw.random() < 0.5:
        return [], 0
    when, ticks = begin - int(draw.integers(12, 60)), int(draw.integers(1, 3))
    if row.raises is not None and row.overlaps and draw.random() < 0.5:
        when = begin + int(draw.integers(-2, 3))
    kind = str(draw.choice(["late", "no reply", "frozen"]))
    hides = max(0, when + ticks - begin) if kind != "late" else 0
    return [Fault(kind, when, ticks, 0.4e-3 if kind == "late" else 0.0)], hides


def variant(row: Row, seed: int) -> Variant:
    """Run one drawn variant of `row`; what it got wrong stands in `problems`."""
    draw = np.random.default_rng([seed, ROWS.index(row)])
    delay = int(draw.integers(2))
    tick = make_tick(CONFIG, delay, MODEL)
    ring = Ring.create(TICKS, tick.row_width)
    bed = Bed(tick, ring, Stop(), TABLES[delay].copy())
    faults, begin = row.draw(draw, bed)
    harmless, hidden = beside(row, draw, begin)
    faults += harmless
    bench = Bench(stage=CONFIG.stage, period=CONFIG.period, seed=seed)
    plant = Plant(SimulatedSettings(driver="simulated", delay_ticks=delay), bench)  # type: ignore[arg-type]
    device, machine = FaultyDevice(plant, faults), Machine()
    told: list[tuple[float, int, str]] = []
    error: Exception | None = None
    outcome = None
    try:
        outcome = run(
            device, tick, TablePlan(bed.table), FaultyClock(VirtualClock(), faults), ring, stop=bed.stop,
            machine=machine, tell=lambda *what: told.append(what),
        )  # fmt: skip
    except RtcompError as caught:
        error = caught
    rows = ring.take()
    ring.release()
    column = {name: rows[:, j] for j, name in enumerate(COLUMNS)}
    problems = _accounted(column, plant)
    reaction = -1
    if row.raises is not None or row.name == "signal":
        reaction = _ticks_to_zero(row, column, plant, begin, delay)
        allowed = row.within + delay + hidden
        if reaction > allowed:
            problems.append(f"{reaction} ticks until zero at the plant, allowed {allowed}")
    if row.raises is not None:
        problems += _ended(row, error, machine, told)
    else:
        problems += _went_on(row, error, outcome, machine, column, begin)
    return Variant(reaction, [f"{p} (seed {seed}, {faults})" for p in problems])


def _accounted(column: dict[str, np.ndarray], plant: Plant) -> list[str]:
    """Every tick has its row, rows hold numbers or what was injected, and the plant ended at zero."""
    problems = []
    if not np.allclose(column["time"], CONFIG.period * np.arange(len(column["time"])), rtol=0, atol=1e-12):
        problems.append("rows are missing in the recording")
    if not np.isfinite(column["voltage"]).all():
        problems.append("a command that is no number was recorded")
    if not plant.volts or plant.volts[-1] != 0.0:
        problems.append("the plant did not end at zero volts")
    if not np.isfinite(plant.volts).all() or np.abs(plant.volts).max() > CONFIG.voltage_limit:
        problems.append("the plant had a voltage beyond the limit, or none that is a number")
    return problems


def _ticks_to_zero(row: Row, column: dict[str, np.ndarray], plant: Plant, begin: int, delay: int) -> int:
    """Ticks from the fault until the plant was advanced by zero for good."""
    driven = np.flatnonzero(np.asarray(plant.volts))
    served = np.flatnonzero(column["overrun"] != 2)  # advance k comes with the exchange of served tick k + 1
    last = int(driven[-1]) + 1 if len(driven) else 0
    last = int(served[min(last, len(served) - 1)])
    if row.after:  # from when it was driven without a break
        weak = np.flatnonzero(np.abs(column["voltage"][: last - delay]) < DRIVEN)
        begin = max(begin, int(weak[-1]) + 1)
    return max(0, last - begin + 1)


def _ended(
    row: Row, error: Exception | None, machine: Machine, told: list[tuple[float, int, str]]
) -> list[str]:
    if error is None:
        return ["the run went on"]
    problems = []
    assert row.raises is not None
    if not isinstance(error, row.raises) or row.says not in str(error):
        problems.append(f"{type(error).__name__}: {error}")
    if "\n" in str(error):
        problems.append("more than one line")
    if machine.state is not State.FAULT or not machine.why:
        problems.append(f"state {machine.state.name}")
    if len(told) != 1 or told[0][1] != State.FAULT or not told[0][2]:
        problems.append(f"told {told}")
    return problems


def _went_on(
    row: Row,
    error: Exception | None,
    outcome: Outcome | None,
    machine: Machine,
    column: dict[str, np.ndarray],
    begin: int,
) -> list[str]:
    if error is not None or outcome is None:
        return [f"ended by {type(error).__name__}: {error}"]
    problems = []
    if machine.state is not State.DISCONNECTED:
        problems.append(f"state {machine.state.name}")
    if row.name == "signal":
        return problems if outcome.stopped_by == "signal" else [f"stopped by {outcome.stopped_by}"]
    if outcome.stopped_by != "end" or outcome.ticks != TICKS:
        problems.append(f"ended by {outcome.stopped_by} after {outcome.ticks} ticks")
    degraded = column["state"] == State.DEGRADED
    served = degraded & (column["overrun"] != 2)
    if row.degrades is not None and bool(degraded.any()) != row.degrades:
        problems.append(f"degraded: {bool(degraded.any())}")
    if column["feedforward"][served].any():
        problems.append("feedforward while degraded")
    if not np.isfinite(column["force_model"]).all():
        problems.append("a model that is no number")
    steps = np.abs(np.diff(column["voltage"]))
    if steps[begin - 60 :].max() > 1.0:
        problems.append(f"the command jumped by {steps.max():.2f} V")
    error_m = np.abs(column["reference"] - column["position"])[column["status"] == 0]
    if error_m.max() > 2e-4:
        problems.append(f"the axis left its reference by {error_m.max():.2g} m")
    return problems
