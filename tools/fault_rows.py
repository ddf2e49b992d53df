"""The table of faults: what is drawn for each row, and what must come of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rtcomp_drivers.faults import Fault

from rtcomp.errors import DeviceError, DeviceTimeoutError, EmergencyStopError, LimitError, RtcompError
from rtcomp.loop import layout as at
from rtcomp.loop.ring import Ring
from rtcomp.loop.run import Stop
from rtcomp.loop.tick import Tick

FIRST, LAST = 300, 700
"""Ticks between which faults begin: the axis moves, the model feeds forward, the learner learns."""
AGE, LOST, JUMP = 10, 20, 4e-5
"""Ticks without a sample, slots lost, m of an unexplained jump, that the runs put up with."""
Draw = np.random.Generator


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
    go on to its end, degraded where `degrades` says so.
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
