"""Judge a model by what frozen weights predict on recorded motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rtcomp.hysteresis.basis import Basis, regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.kernels import Floats
from rtcomp.stage.balance import bandwidth, known_force, zero_phase
from rtcomp.stage.stage import Stage


@dataclass(frozen=True)
class Friction:
    """What a recording says of friction: time (s), position (m) and force (N), each (K,).

    `good` tells the rows that count: those measured as they were timed, and not near any that were not.
    """

    time: Floats
    position: Floats
    force: Floats
    good: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Judgement:
    """A model against recorded friction. `relative` is rms over the peak of the recorded force."""

    friction: Friction
    model: Floats
    """N, (K,): the model's force along the recorded motion."""
    counted: Floats
    """(K,), 1 where the row counts."""
    rms: float
    """N."""
    relative: float


def friction_of(
    stage: Stage,
    time: Floats,
    position: Floats,
    voltage: Floats,
    delay_ticks: int,
    smoothing_hz: float = 0.0,
    doubtful: npt.NDArray[np.bool_] | None = None,
) -> Friction:
    """Return the friction force along a recording: what the drive gave less what else it moved.

    The force around a row is the mean of the commands that acted before and after it. Velocity and
    acceleration come from the position below a tenth of the rate (at most 100 Hz) or `smoothing_hz`; the
    position that a model shall be driven with is smoothed only where `smoothing_hz` is given.
    Nothing is delayed: the filters run forward and backward. `doubtful` rows (late, stale, outliers) are
    bridged by straight lines, and they and their neighbours, as far as the filters reach, do not count.
    """
    period = float((time[-1] - time[0]) / (time.size - 1))
    good = np.ones(time.size, dtype=np.bool_)
    if doubtful is not None and doubtful.any():
        position = np.interp(time, time[~doubtful], position[~doubtful])
        reach = (
            2 * math.ceil(1.0 / (period * 2 * math.pi * (smoothing_hz or bandwidth(1.0 / period))))
            + delay_ticks
        )
        good = np.convolve(doubtful, np.ones(2 * reach + 1), mode="same") < 0.5
    acts = np.concatenate([np.full(delay_ticks, voltage[0]), voltage[: voltage.size - delay_ticks]])
    before = np.append(acts[:1], acts[:-1])
    cut = smoothing_hz or bandwidth(1.0 / period)
    slow = zero_phase(position, cut, 1.0 / period)
    velocity = np.gradient(slow, period)
    acceleration = np.zeros_like(slow)
    acceleration[1:-1] = (slow[2:] - 2 * slow[1:-1] + slow[:-2]) / period**2
    force = stage.force_constant * 0.5 * (acts + before)
    force = force - stage.mass * acceleration - known_force(stage, time, slow, velocity)
    return Friction(time, slow if smoothing_hz else position, force, good)


def judge(
    model: HysteresisModel, friction: Friction, window: tuple[float, float] | None = None, settle: float = 0.0
) -> Judgement:
    """Compare a frozen model with recorded friction in `window` (s), its first `settle` seconds left out.

    The model is run from the first row, in the virgin state, so that its memory has seen all of the motion.
    """
    force = model.response(friction.position)
    counted = _counted(friction, window, settle)
    difference = (friction.force - force)[counted]
    rms = float(np.sqrt(np.mean(difference**2)))
    peak = float(np.abs(friction.force[counted]).max())
    return Judgement(friction, force, counted.astype(np.float64), rms, rms / peak)


def learning_curve(
    basis: Basis,
    history: Floats,
    offset_scale: float,
    friction: Friction,
    window: tuple[float, float] | None = None,
    settle: float = 0.0,
) -> Floats:
    """Return the relative error of each set of weights in `history`, frozen, on `friction`, (M,).

    history: (M, N + 1), or (M, 2 N + 1) with the widths (m) that the intervals had then.
    """
    counted = _counted(friction, window, settle)
    if history.shape[1] > basis.size + 1:
        return _of_moving(basis.size, history, offset_scale, friction, counted)
    return _curve(basis, history, offset_scale, friction, counted)


def _of_moving(
    count: int, history: Floats, offset_scale: float, friction: Friction, counted: npt.NDArray[np.bool_]
) -> Floats:
    """Return the curve of intervals that moved, from stretch to stretch in which they did not."""
    weights, widths = history[:, : count + 1], history[:, count + 1 :]
    moved = np.flatnonzero((np.diff(widths, axis=0) != 0.0).any(axis=1)) + 1
    parts = []
    for low, high in zip([0, *moved], [*moved, len(history)], strict=True):
        basis = IntervalBasis(widths[low])
        parts.append(_curve(basis, weights[low:high], offset_scale, friction, counted))
    return np.concatenate(parts)


def _curve(
    basis: Basis, history: Floats, offset_scale: float, friction: Friction, counted: npt.NDArray[np.bool_]
) -> Floats:
    x = np.column_stack([regressors(basis, friction.position), np.full(counted.size, offset_scale)])[counted]
    force = friction.force[counted]
    gram, cross, power = x.T @ x, x.T @ force, float(force @ force)
    squares = power - 2 * history @ cross + np.einsum("mi,ij,mj->m", history, gram, history)
    return np.asarray(np.sqrt(np.maximum(squares, 0.0) / force.size) / np.abs(force).max())


def reached(basis: Basis, position: Floats) -> Floats:
    """Return the part (0 to 1) of every element's amplitude that a motion exercises, (N,)."""
    x = regressors(basis, position)
    return np.asarray(np.ptp(x, axis=0) / (2 * basis.scales()))


def _counted(friction: Friction, window: tuple[float, float] | None, settle: float) -> npt.NDArray[np.bool_]:
    time = friction.time
    first, last = (time[0], time[-1]) if window is None else window
    return np.asarray((time >= first + settle) & (time <= last) & friction.good)
