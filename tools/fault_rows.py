"""The table of faults: what is drawn for each row, what must come of it, and one run of it on a stage.

Everything in virtual time on the simulated Leuven stage, identifying and compensating; what counts is what
the plant's side saw: the volts by which the simulation was advanced.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.faults import Fault, FaultyClock, FaultyDevice
from rtcomp_drivers.simulated import SimulatedDriver, SimulatedSettings

from rtcomp.errors import DeviceError, DeviceTimeoutError, EmergencyStopError, LimitError, RtcompError
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import ALWAYS
from rtcomp.jobs.plan import ReferencePlan
from rtcomp.jobs.session import make_tick
from rtcomp.loop import layout as at
from rtcomp.loop.clock import VirtualClock
from rtcomp.loop.ring import Ring
from rtcomp.loop.run import Stop, run
from rtcomp.loop.states import Machine, State
from rtcomp.loop.tick import COLUMNS, Tick

TICKS = 1400
FIRST, LAST = 300, 700
"""Ticks between which faults begin: the axis moves, the model feeds forward, the learner learns."""
AGE, LOST, JUMP, DRIVEN = 10, 20, 4e-5, 2.0
"""Ticks without a sample, slots lost, m of an unexplained jump, that the runs put up with; V at which the
axis must move (friction is 1.2 V)."""
Draw = np.random.Generator


class Plant(SimulatedDriver):
    """The simulated stage, with a note of every voltage that it was advanced by."""

    def __init__(self, settings: SimulatedSettings, bench: Bench) -> None:
        super().__init__(settings, bench)
        self.volts: list[float] = []
        self.exchanges = 0

    def open(self) -> None:
        """Open, and begin to take notes."""
        super().open()
        advance = self.simulator.advance

        def noting(volts: float, seconds: float) -> None:
            self.volts.append(volts)
            advance(volts, seconds)

        self.simulator.advance = noting  # type: ignore[method-assign]


@dataclass
class Bed:
    """What a row may put its fault into."""

    tick: Tick
    ring: Ring
    stop: Stop
    table: np.ndarray


Drawing = Callable[[Draw, Bed], tuple[list[Fault], int]]
"""Makes the faults of a variant, and says from which tick on they are there."""


@dataclass(frozen=True)
class Row:
    """A row of the table. `draw` makes the faults of a variant and says from which tick on they are there.

    `raises` is what must end the run, with these words, `within` ticks at the plant; None where the run must
    go on to its end, degraded where `degrades` says so. `until` (ticks) is how long a fault may need to show.
    """

    name: str
    draw: Drawing
    raises: type[RtcompError] | None = None
    says: str = ""
    within: int = 1
    degrades: bool | None = None
    overlaps: bool = True
    """Whether samples may also be missing where the fault begins."""
    after: str = ""
    """What the figure is counted from, where it is not the fault itself."""


@dataclass
class Variant:
    """One run of a row: what came of it."""

    reaction: int
    """Ticks from the fault until the plant had zero volts, for good; -1 where the run went on."""
    problems: list[str] = field(default_factory=list)


def at_any(draw: Draw) -> int:
    return int(draw.integers(FIRST, LAST))


def one(kind: str, ticks: float = math.inf, size: Callable[[Draw], float] = lambda _: 0.0) -> Drawing:
    def draw(draw: Draw, _: Bed) -> tuple[list[Fault], int]:
        begin = at_any(draw)
        return [Fault(kind, begin, ticks, size(draw))], begin

    return draw


def signed(low: float, high: float) -> Callable[[Draw], float]:
    """A size between, evenly over its decades, of either sign."""
    return lambda draw: float(draw.choice([-1.0, 1.0]) * low * (high / low) ** draw.random())


def some(kind: str, low: int, high: int) -> Drawing:
    def draw(draw: Draw, _: Bed) -> tuple[list[Fault], int]:
        begin = at_any(draw)
        return [Fault(kind, begin, int(draw.integers(low, high + 1)))], begin

    return draw


def late(slots: tuple[float, float], ticks: tuple[int, int]) -> Drawing:
    def draw(draw: Draw, _: Bed) -> tuple[list[Fault], int]:
        begin = at_any(draw)
        return [Fault("late", begin, int(draw.integers(*ticks)), 1e-3 * draw.uniform(*slots))], begin

    return draw


def doing(what: Callable[[Draw, Bed], None]) -> Drawing:
    def draw(draw: Draw, bed: Bed) -> tuple[list[Fault], int]:
        begin = at_any(draw)
        return [Fault("call", begin, 1, call=lambda: what(draw, bed))], begin

    return draw


def wrong_command(draw: Draw, bed: Bed) -> tuple[list[Fault], int]:
    begin = at_any(draw)
    column = [at.LEAD_FORCE, at.REFERENCE][int(draw.integers(2))]
    bed.table[begin, column] = draw.choice([math.nan, math.inf, -math.inf])
    return [], begin


def diverge(draw: Draw, bed: Bed) -> None:
    """Spoil the identifier as a bad update would: covariance or weights, no number or far too large."""
    identifier = bed.tick.identifier
    if draw.random() < 0.5:
        size = identifier.w.size**2
        identifier.ls[int(draw.integers(size))] = draw.choice([math.nan, math.inf, -math.inf])
    else:
        bad = draw.choice([math.nan, math.inf, -1e30, 1e30])
        identifier.w[int(draw.integers(identifier.w.size))] = bad


def hidden_slip(draw: Draw, _: Bed) -> tuple[list[Fault], int]:
    """A slip while one or two samples are missing, beyond what could have happened in that time."""
    begin, missing = at_any(draw), int(draw.integers(1, 3))
    return [
        Fault("no reply", begin - missing, missing),
        Fault("jump", begin, math.inf, signed(7 * JUMP, 0.9e-3)(draw)),
    ], begin


def no_numbers(draw: Draw) -> float:
    return float(draw.choice([math.nan, math.inf, -math.inf, 1e-310, -5e-324]))


SLIP = signed(1.5 * JUMP, 0.9e-3)
CODE = lambda d: float(d.integers(1, 65536))  # noqa: E731 - a size to be drawn
STOPS = doing(lambda d, bed: bed.ring.stop(int(d.integers(1, 4))))
SIGNALS = doing(lambda _, bed: setattr(bed.stop, "requested", True))
STANDS = "did not move"
ROWS = [
    Row("a late tick", late((0.11, 0.99), (1, 3)), degrades=False),
    Row("three late in a row", late((0.51, 0.99), (3, 9)), degrades=True),
    Row("slots lost, fewer than 20", late((1.0, 15.0), (1, 2)), degrades=True),
    Row("20 slots lost", late((20.01, 200.0), (1, 2)), DeviceError, "20 slots lost", 0),
    Row("no reply, at most 10 ticks", some("no reply", 1, AGE), degrades=False),
    Row("no reply, longer", one("no reply"), DeviceTimeoutError, "no new sample", AGE + 1),
    Row("frozen", one("frozen"), DeviceError, "stands still", at.REPEATED_TICKS),
    Row("sent twice", some("frozen", 1, at.REPEATED_TICKS - 1), degrades=False),
    Row("reordered", some("reordered", 1, 2), degrades=False),
    Row("no number in a sample", one("not a number", 6, no_numbers), DeviceError, "reported the position"),
    Row("no number in a command", wrong_command, LimitError, "the command is no number"),
    Row("encoder jump", one("jump", 3, SLIP), LimitError, "position", overlaps=False),
    Row("index slip", one("jump", math.inf, SLIP), LimitError, "position", overlaps=False),
    Row("index slip behind samples lost", hidden_slip, LimitError, "position", overlaps=False),
    Row("stuck while driven", one("stuck"), LimitError, STANDS, 52, after="driven"),
    Row("sign flipped", one("sign flipped"), LimitError, "", 52, after="driven"),
    Row("beam lost", one("beam lost"), DeviceError, "must not be used"),
    Row("travel", one("jump", math.inf, signed(1.5e-3, 1.0)), LimitError, "left the travel"),
    Row("identifier diverges", doing(diverge), degrades=True),
    Row("e-stop, file or key", STOPS, EmergencyStopError, "emergency stop"),
    Row("e-stop of the device", one("device e-stop"), EmergencyStopError, "the device itself"),
    Row("signal", SIGNALS, None, within=2),
    Row("device error, once", one("device error", 1, CODE), DeviceError, "reports error"),
    Row("device error, for good", one("device error", math.inf, CODE), DeviceError, "reports error"),
    Row("unplug", one("unplug"), DeviceError, "has gone"),
    Row("counter wrap", one("wrap", math.inf, lambda d: 2.0 ** float(d.choice([8, 16, 32]))), degrades=False),
]
"""Every fault that can be put in on the host's side, with what must come of it."""


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


def _went_on(row, error, outcome, machine, column, begin) -> list[str]:  # type: ignore[no-untyped-def]
    if error is not None:
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
