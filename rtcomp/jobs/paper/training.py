"""The paper's training: rule (8) cycle by cycle, the weights frozen after each and judged on other motion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rtcomp.hysteresis.basis import Basis, regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.hysteresis.rls import Rls
from rtcomp.jobs.judge import Friction
from rtcomp.jobs.paper.claim import cycles_until
from rtcomp.jobs.paper.rig import CYCLE
from rtcomp.kernels import Floats, call_learner, compiled

LEVEL, STAY = 0.05, 10
"""The paper's limit of error, over the peak force; and for how many cycles in a row it must be kept."""
_CHUNK = 10
"""Cycles whose regressors are held in memory at a time."""

Taught = tuple[Floats, Floats]
"""Activations with the bias in the last column, (K, N + 1) m, and forces (K,) N."""


def activations(
    basis: Basis, position: Floats, state: Floats | None = None, held: Floats | None = None
) -> Floats:
    """Return the regressors of (6) along `position` (m, (K,)), the bias last, (K, N + 1).

    Of intervals the paper's own x_i in [0, a_i], not centred. The bias is a constant of their mean size (m),
    so that one learning factor suits all. `state` and `held` as `hysteresis.basis.regressors` takes them.
    """
    x = regressors(basis, position, state, held)
    if isinstance(basis, IntervalBasis):
        x = x + basis.widths / 2
    return np.column_stack([x, np.full(position.size, bias_of(basis))])


def bias_of(basis: Basis) -> float:
    """Return the constant (m) whose weight is the bias: the mean amplitude of the regressors, doubled."""
    return 2.0 * float(basis.scales().mean())


def model_of(basis: Basis, w: Floats) -> HysteresisModel:
    """Return the weights (N + 1,) of `activations` as a model."""
    offset = w[-1] * bias_of(basis)
    if isinstance(basis, IntervalBasis):
        offset += float(w[:-1] @ basis.widths) / 2
    return HysteresisModel(basis, w[:-1], float(offset))


@dataclass(frozen=True)
class Exam:
    """Motion that frozen weights are judged on, folded so that judging costs no samples."""

    gram: Floats
    cross: Floats
    power: float
    rows: int
    peak: float
    """N, the largest force."""

    @classmethod
    def on(
        cls,
        basis: Basis,
        shown: Friction,
        settle: int = CYCLE,
        x: Floats | None = None,
        rows: npt.NDArray[np.integer[Any]] | None = None,
    ) -> Exam:
        """Judge on `shown`, its first `settle` rows left out, or on the given `rows` (indices) of it.

        `x` are its activations where they are known.
        """
        x = activations(basis, shown.position) if x is None else x
        taken = np.arange(settle, shown.force.size) if rows is None else rows
        x, force = x[taken], shown.force[taken]
        return cls(x.T @ x, x.T @ force, float(force @ force), force.size, float(np.abs(force).max()))

    def error(self, w: Floats) -> float:
        """Return the rms error of the weights (N + 1,) over the peak force."""
        squares = self.power - 2.0 * float(w @ self.cross) + float(w @ self.gram @ w)
        return math.sqrt(max(squares, 0.0) / self.rows) / self.peak


@dataclass(frozen=True)
class Lesson:
    """A recorded motion to train on: its rows once, then from row `again` on over and over.

    Noise is uniform and drawn anew for every sample: `position_noise` (m) in what the operator is driven
    with,
    `force_noise` (N) in what it is to say.
    """

    basis: Basis
    position: Floats
    force: Floats
    again: int
    position_noise: float = 0.0
    force_noise: float = 0.0
    seed: int = 0
    noise_every: int = 1
    """Rows between two draws of the position noise; straight lines between."""
    known: Floats | None = None
    """Activations of the rows where they are known, (K, N + 1): of rows that do not follow each other."""

    def activations(self) -> Floats:
        """Return the activations along the rows once, without noise, (K, N + 1)."""
        return activations(self.basis, self.position) if self.known is None else self.known

    def cycles(self) -> Iterator[Taught]:
        """Give cycle after cycle of `CYCLE` samples, without end."""
        chance = np.random.default_rng([self.seed, 3])
        state = self.basis.initial_state()
        held = np.zeros(self.basis.size)
        rows = np.arange(self.force.size)
        while True:
            for start in range(0, rows.size, CYCLE * _CHUNK):
                part = rows[start : start + CYCLE * _CHUNK]
                if self.known is not None:
                    x = self.known[part]
                else:
                    u = self.position[part]
                    if self.position_noise:
                        u = u + self.position_noise * self._noise(chance, u.size)
                    x = activations(self.basis, u, state, held)
                force = self.force[part]
                if self.force_noise:
                    force = force + self.force_noise * chance.uniform(-1, 1, force.size)
                for k in range(0, part.size, CYCLE):
                    yield x[k : k + CYCLE], force[k : k + CYCLE]
            rows = np.arange(self.again, self.force.size)

    def _noise(self, chance: np.random.Generator, rows: int) -> Floats:
        if self.noise_every == 1:
            return chance.uniform(-1, 1, rows)
        draws = chance.uniform(-1, 1, rows // self.noise_every + 2)
        return np.interp(np.arange(rows) / self.noise_every, np.arange(draws.size), draws)


@dataclass(frozen=True)
class Trained:
    """What training came to: the error after each cycle (1, (n,)), weights frozen, and the last weights."""

    errors: Floats
    weights: Floats

    @property
    def cycles(self) -> float:
        """Cycles until the error stays below the paper's limit; infinite where it does not."""
        return cycles_until(list(self.errors), LEVEL, STAY)


def lms_gain(lesson: Lesson, step: float) -> float:
    """Return the learning factor of (8), `step` over the mean squared norm of clean activations (1/m^2)."""
    x = lesson.activations()
    return step / float(np.mean(np.sum(x**2, axis=1)))


def train(
    lesson: Lesson, exam: Exam, step: float, most: int, *, whole: bool = False, weights: Floats | None = None
) -> Trained:
    """Train by the paper's rule (8) with learning factor `lms_gain`, from zero or `weights` (N + 1,).

    Ends after `most` cycles, or, unless `whole`, as soon as the error has stayed below the paper's limit.
    """
    w = np.zeros(lesson.basis.size + 1) if weights is None else weights.copy()
    gain = lms_gain(lesson, step)
    errors: list[float] = []
    for x, force in lesson.cycles():
        _rule_8(x, force, w, gain)
        errors.append(exam.error(w) if np.isfinite(w).all() else math.inf)
        if len(errors) == most or (not whole and cycles_until(errors[-STAY:], LEVEL, STAY) == 1.0):
            break
    return Trained(np.array(errors), w)


@compiled
def _rule_8(x: Floats, force: Floats, w: Floats, gain: float) -> None:
    for k in range(x.shape[0]):
        error = force[k]
        for i in range(x.shape[1]):
            error -= w[i] * x[k, i]
        for i in range(x.shape[1]):
            w[i] += gain * error * x[k, i]


def train_rls(lesson: Lesson, exam: Exam, most: int) -> Trained:
    """Train by recursive least squares without forgetting in place of (8); ends as `train` does."""
    learner = Rls(forgetting=1.0)
    scales = np.append(lesson.basis.scales(), bias_of(lesson.basis))
    p, s, w = learner.vector(scales), learner.initial_state(scales), np.zeros(scales.size)
    errors: list[float] = []
    for x, force in lesson.cycles():
        _with_learner(learner.kernel.address, p, s, np.ascontiguousarray(x), force, w)
        errors.append(exam.error(w))
        if len(errors) == most or cycles_until(errors[-STAY:], LEVEL, STAY) == 1.0:
            break
    return Trained(np.array(errors), w)


@compiled
def _with_learner(address: int, p: Floats, s: Floats, x: Floats, force: Floats, w: Floats) -> None:
    for k in range(x.shape[0]):
        row = x[k]
        error = force[k] - np.dot(w, row)
        call_learner(address, p.ctypes.data, s.ctypes.data, row.ctypes.data, w.ctypes.data, error)
