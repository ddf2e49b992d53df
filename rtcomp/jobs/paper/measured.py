"""A recording in the place of the paper's real setup: its loops, cut into cycles of 1000 samples."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rtcomp.errors import RecordingError
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.inspection.branches import turning_points
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.judge import Friction, friction_of
from rtcomp.jobs.paper.minor import Lessons
from rtcomp.jobs.paper.rig import CYCLE, INTERVALS
from rtcomp.jobs.paper.training import Exam, Lesson, activations, train
from rtcomp.kernels import Floats
from rtcomp.recording.reader import Recording

ALIKE = 0.15
"""Cycles belong together that differ by no more of their travel."""
LEAST_MAIN, LEAST_MINOR = 4, 2
TURN = 0.1
"""Of the whole travel: less is not taken for a reversal."""


@dataclass(frozen=True)
class Measured:
    """A recording's friction, cycle after cycle of `CYCLE` samples each, and which are the main loop."""

    friction: Friction
    main: range
    minor: list[int]
    axis: str
    name: str

    def rows(self, cycles: Sequence[int]) -> npt.NDArray[np.int64]:
        """Return the rows of these cycles."""
        return np.concatenate([np.arange(k * CYCLE, (k + 1) * CYCLE) for k in cycles])

    def part(self, cycles: Sequence[int]) -> tuple[Floats, Floats]:
        """Return position (m or rad) and force (N or N m) of these cycles, one after the other."""
        rows = self.rows(cycles)
        return self.friction.position[rows], self.friction.force[rows]


def cut(config: Configuration, recording: Recording) -> Measured:
    """Cut a recording into cycles from low to low and find its main loop.

    The main loop is the largest that comes at least four times in a row, cycle by cycle alike within 15 %;
    minor loops are smaller. `config` says the axis and how its friction is had (smoothing included). Raises
    RecordingError where there is no such loop, or no minor ones.
    """
    smoothing = config.run.identify.smoothing if config.run.identify is not None else 0.0
    shown = friction_of(
        config.stage,
        recording.time,
        recording.position,
        recording.voltage,
        config.run.recording.delay_ticks,
        smoothing,
        ~recording.trusted,
    )
    position = shown.position
    turns = turning_points(position, TURN * float(np.ptp(position)))
    lows = [int(t) for k, t in enumerate(turns) if position[t] < position[turns[k - 1 if k else 1]]]
    travel = np.array([np.ptp(position[a : b + 1]) for a, b in itertools.pairwise(lows)])
    main = _main(travel)
    if main is None:
        raise RecordingError(
            f"{recording.path}: no loop comes {LEAST_MAIN} times in a row within {100 * ALIKE:g} % of its "
            f"travel ({travel.size} cycles were found); record the main loop at least {LEAST_MAIN} times"
        )
    size = float(np.median(travel[main.start : main.stop]))
    ends = list(itertools.pairwise(lows))
    minor = [
        k
        for k, t in enumerate(travel)
        if t < (1.0 - 2.0 * ALIKE) * size and closed(position[slice(*ends[k])], shown.force[slice(*ends[k])])
    ]
    if len(minor) < LEAST_MINOR:
        raise RecordingError(
            f"{recording.path}: {len(minor)} closed loops are clearly smaller than the main one; at least "
            f"{LEAST_MINOR} are needed: record minor loops too"
        )
    rows = np.concatenate([np.linspace(a, b, CYCLE, endpoint=False) for a, b in itertools.pairwise(lows)])
    count = np.arange(position.size, dtype=np.float64)
    even = Friction(
        np.interp(rows, count, shown.time),
        np.interp(rows, count, position),
        np.interp(rows, count, shown.force),
        np.interp(rows, count, shown.good.astype(np.float64)) > 0.5,
    )
    return Measured(even, main, minor, config.stage.axis, recording.path.name)


def closed(position: Floats, force: Floats) -> bool:
    """Say whether a cycle ends where it began, within a tenth of its size, and nowhere jumps by as much."""
    ends = [abs(a[-1] - a[0]) <= 0.1 * np.ptp(a) for a in (position, force)]
    return bool(all(ends) and np.abs(np.diff(force)).max() <= 0.1 * np.ptp(force))


def _main(travel: Floats) -> range | None:
    best: range | None = None
    for first in range(travel.size):
        last = first + 1
        while last < travel.size and abs(travel[last] - travel[first]) <= ALIKE * travel[first]:
            last += 1
        if last - first >= LEAST_MAIN and (best is None or travel[first] > 1.1 * travel[best.start]):
            best = range(first, last)
    return best


def measured_lessons(of: Measured) -> Lessons:
    """Return the lessons of a recording: every other cycle of either kind is learned from, the others judged.

    The operator goes through the whole recording once, from the virgin state, so that it remembers what the
    axis
    did before each cycle.
    """
    size = float(np.median([np.ptp(of.part([k])[0]) for k in of.main]))
    basis = IntervalBasis.over(INTERVALS, size)
    x = activations(basis, of.friction.position)

    def lesson(cycles: Sequence[int]) -> Lesson:
        rows = of.rows(cycles)
        return Lesson(basis, *of.part(cycles), 0, known=x[rows])

    def exam(cycles: Sequence[int]) -> Exam:
        rows = of.rows(cycles)
        return Exam.on(basis, of.friction, x=x, rows=rows[of.friction.good[rows]])

    # The first of the main loop still wipes out what the smaller ones left.
    main, later = of.main[1::2], of.main[2::2]
    taught = of.minor[::2]
    shown = slice(max(0, len(taught) - 2) * CYCLE, (len(taught) + 1) * CYCLE)
    both = lesson([*taught, *main])
    return Lessons(lesson(main), both, exam(later), exam(of.minor[1::2]), shown)


def cycles_on(of: Lessons, step: float, most: int, level: float, own: bool, seed: int) -> float:
    """Return the cycles to 5 % of the recording's main loop with output noise of `level` over its peak.

    own: judged on the loop learned from, without noise; else on the later cycles of the main loop.
    """
    lesson = replace(of.main, force_noise=level * of.on_main.peak, seed=seed)
    every = np.arange(of.main.force.size)
    shown = Friction(of.main.force, of.main.position, of.main.force, every >= 0)
    exam = Exam.on(lesson.basis, shown, x=of.main.activations(), rows=every) if own else of.on_main
    return train(lesson, exam, step, most).cycles
