"""Which shape a hysteresis has: nested models judged on motion not learned from; the smallest that pays.

Each candidate learns the recorded motion sample by sample, one block of it left out in turn, and is judged
with frozen weights on that block; its memory sees all of the motion. What is chosen is the smallest model
whose error is not significantly above the best one's. A part that the motion says too little about is not
tried. The symmetric operator is always among the candidates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from rtcomp.hysteresis.basis import Basis, regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.learner import Learner
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.hysteresis.shaped import ShapedIntervalBasis
from rtcomp.jobs.configuration import AUTO, Configuration
from rtcomp.jobs.judge import Friction, reached
from rtcomp.jobs.tick_settings import NOISE_COUNTS
from rtcomp.kernels import Floats, call_learner, compiled

LADDER: tuple[tuple[str, ...], ...] = (
    (), ("output",), ("reversible",), ("reversible", "output"), ("reversible", "position"),
    ("reversible", "position", "output"),
)  # fmt: skip
"""Parts tried, each alone and with a skew."""
BLOCKS = 6
ROWS_A_WEIGHT = 20
"""Updates needed for each weight that is learned."""
LEAST_GAIN = 0.02
"""Share of its error that a larger model must take away, significant or not."""
_SKEWS = np.linspace(-0.4, 0.4, 9)
_FINEST = 2e-4
_ROUNDS = 2
"""Times that the shape of the output is taken from the weights just learned."""
_T = {2: 6.31, 3: 2.92, 4: 2.35, 5: 2.13, 6: 2.02, 7: 1.94, 8: 1.89, 9: 1.86, 10: 1.83}
"""Student's t, one-sided 95 %, by the number of blocks."""
_SIGNS = 5
"""Blocks from which being worse in every one is significant by itself: 2^-5 is below 5 % (sign test)."""


@dataclass(frozen=True)
class Motion:
    """Recorded friction to learn from: position (m) and force (N), (K,); rows that count; rest is memory."""

    position: Floats
    force: Floats
    good: npt.NDArray[np.bool_]
    gate: float = 0.0
    grain: float = 0.0
    """m, the noise of the position: what a skew must not take for motion."""


@dataclass(frozen=True)
class Candidate:
    """A model that was tried: what it adds, its size, and its squared error (N^2) on each block held out."""

    parts: tuple[str, ...]
    skew: float
    weights: int
    squares: Floats

    @property
    def rms(self) -> float:
        """Error (N) over all blocks held out."""
        return float(np.sqrt(self.squares.mean()))

    @property
    def typical(self) -> float:
        """Geometric mean (N) over the blocks: one that errs much has no more say than the others."""
        return float(np.exp(0.5 * np.log(np.maximum(self.squares, 1e-300)).mean()))

    def __str__(self) -> str:
        """Name it as a person would."""
        added = [*self.parts, *([f"skew {self.skew:+.3g}"] if self.skew else [])]
        return " + ".join(["symmetric", *added])


@dataclass(frozen=True)
class Choice:
    """The model that was chosen, learned on all of the motion, and what became of the others."""

    model: HysteresisModel
    chosen: Candidate
    tried: list[Candidate] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


@compiled
def _learn_rows(
    address: int, p: Floats, s: Floats, x: Floats, force: Floats, rows: npt.NDArray[np.int64], w: Floats
) -> None:
    for k in rows:
        error = force[k] - np.dot(w, x[k])
        call_learner(address, p.ctypes.data, s.ctypes.data, x[k].ctypes.data, w.ctypes.data, error)


def learned(basis: Basis, learner: Learner, x: Floats, force: Floats, rows: npt.NDArray[np.int64]) -> Floats:
    """Return weights (size + 1,) learned from regressors (K, size + 1) and force (N, (K,)) row by row."""
    scales = np.append(basis.scales(), x[0, -1])
    w = np.zeros(x.shape[1])
    vector, state = learner.vector(scales), learner.initial_state(scales)
    _learn_rows(learner.kernel.address, vector, state, x, force, rows, w)
    return w


def with_offset(basis: Basis, position: Floats) -> Floats:
    """Return the regressors (K, size + 1) along a motion, the last column the offset's constant (m)."""
    x = regressors(basis, position)
    return np.column_stack([x, np.full(position.size, basis.scales().mean())])


def smallest_that_pays(candidates: Sequence[Candidate]) -> int:
    """Return the place of the candidate with the fewest weights whose error is not significantly the worse.

    Paired over the blocks held out, by the logarithm of the error, for blocks differ in how much moves in
    them: one-sided 95 % against the best, and never for less than 2 % of the error.
    """
    best = min(candidates, key=lambda c: c.rms)
    order = sorted(range(len(candidates)), key=lambda i: (candidates[i].weights, bool(candidates[i].skew)))
    for i in order:
        worse = 0.5 * np.log(np.maximum(candidates[i].squares, 1e-300) / np.maximum(best.squares, 1e-300))
        count = worse.size
        doubt = _T.get(count, 1.8) * float(worse.std(ddof=1)) / np.sqrt(count) if count > 1 else 0.0
        always = count >= _SIGNS and bool((worse > 0.0).all())
        if worse.mean() <= (LEAST_GAIN if always else max(doubt, LEAST_GAIN)):
            return i
    return candidates.index(best)


def choose(plain: IntervalBasis, learner: Learner, motion: Motion, blocks: int = BLOCKS) -> Choice:
    """Try the ladder of models over the intervals of `plain` on a recorded motion and choose.

    Notes say what was left off, and why. Nothing is raised for little data: the symmetric operator is left.
    """
    rows = _gated(motion)
    parts_of_time = np.array_split(rows, blocks)
    left: list[str] = []
    tried: list[Candidate] = []
    skew = (
        _best_skew(plain, learner, motion, rows, parts_of_time) if rows.size >= _needed(plain.size) else 0.0
    )
    for parts in LADDER:
        basis = ShapedIntervalBasis(plain.widths, parts)
        needed = _needed(basis.size)
        if parts and rows.size < needed:
            left.append(f"{' + '.join(parts)} ({needed})")
            continue
        for amount in dict.fromkeys((0.0, skew)):
            tried.append(_judged(plain.widths, parts, amount, learner, motion, rows, parts_of_time))
    chosen = tried[smallest_that_pays(tried)]
    found, w = _fitted(plain.widths, chosen.parts, chosen.skew, learner, motion, rows)
    notes = [_verdict(chosen, tried)]
    if left:
        notes.append(
            f"left off for want of data, {rows.size} updates: {', '.join(left)}, in brackets how many it "
            "takes; record longer, make identify.gate smaller, or take fewer intervals"
        )
    offset = float(w[-1] * found.scales().mean())
    return Choice(HysteresisModel(found, w[:-1], offset), chosen, tried, notes)


def that_pays(
    config: Configuration, model: HysteresisModel, friction: Friction, window: tuple[float, float]
) -> tuple[HysteresisModel, list[str]]:
    """Return the model that ``identify: {model: auto}`` chooses on what was learned from, with notes.

    That is `model`, the symmetric one that the loop has learned, unless a shape pays. `window` (s) is when
    the weights might change. Any other ``identify.model`` is left as it is.
    """
    plain = config.basis()
    if config.identify.model != AUTO or not isinstance(plain, IntervalBasis):
        return model, []
    rows = friction.time <= window[1]
    good = friction.good & (friction.time >= window[0])
    sensor = config.stage.sensor
    grain = 0.5 * (sensor.resolution + NOISE_COUNTS * sensor.noise)  # to either side
    motion = Motion(friction.position[rows], friction.force[rows], good[rows], config.identify.gate, grain)
    choice = choose(plain, config.learner(), motion)
    if isinstance(choice.model.basis, IntervalBasis):
        return model, choice.notes
    part = reached(choice.model.basis, motion.position)
    weights = np.where(part == 0.0, 0.0, choice.model.weights)
    return HysteresisModel(choice.model.basis, weights, choice.model.offset, part), choice.notes


def _verdict(chosen: Candidate, tried: Sequence[Candidate]) -> str:
    best, plain = min(tried, key=lambda c: c.rms), tried[0]
    says = f"model {chosen}: held-out error {chosen.rms:.3g} N, the symmetric operator's {plain.rms:.3g} N"
    if best is not chosen:
        says += (
            f"; {best} has {best.rms:.3g} N with {best.weights} weights for {chosen.weights}: does not pay"
        )
    return says


def _needed(weights: int) -> int:
    return ROWS_A_WEIGHT * weights


def _gated(motion: Motion) -> npt.NDArray[np.int64]:
    """Return the rows at which the axis has moved by the gate since the last, as the loop takes them."""
    rows, last = [], motion.position[0]
    for k, (u, good) in enumerate(zip(motion.position.tolist(), motion.good.tolist(), strict=True)):
        if good and abs(u - last) >= motion.gate:
            rows.append(k)
            last = u
    return np.array(rows, dtype=np.int64)


def _fitted(
    widths: Floats, parts: tuple[str, ...], skew: float, learner: Learner, motion: Motion,
    rows: npt.NDArray[np.int64],
) -> tuple[Basis, Floats]:  # fmt: skip
    """Return the basis, the shape of its output taken from what it learned, and its weights."""
    if not parts and not skew:
        plain = IntervalBasis(widths)
        return plain, learned(plain, learner, with_offset(plain, motion.position), motion.force, rows)
    grain = motion.grain if skew else 0.0
    basis = ShapedIntervalBasis(widths, parts, skew=skew, grain=grain)
    w = learned(basis, learner, with_offset(basis, motion.position), motion.force, rows)
    for _ in range(_ROUNDS if "output" in parts else 0):
        slopes = w[: widths.size]
        if not float(slopes @ widths) > 0.0:
            break
        basis = ShapedIntervalBasis(widths, parts, skew=skew, grain=grain, shape=slopes)
        w = learned(basis, learner, with_offset(basis, motion.position), motion.force, rows)
    return basis, w


def _judged(
    widths: Floats, parts: tuple[str, ...], skew: float, learner: Learner, motion: Motion,
    rows: npt.NDArray[np.int64], blocks: Sequence[npt.NDArray[np.int64]],
) -> Candidate:  # fmt: skip
    squares = []
    for block in blocks:
        basis, w = _fitted(widths, parts, skew, learner, motion, np.setdiff1d(rows, block))
        error = with_offset(basis, motion.position)[block] @ w - motion.force[block]
        squares.append(float(np.mean(error**2)))
    return Candidate(parts, skew, basis.size, np.array(squares))


def _best_skew(
    plain: IntervalBasis, learner: Learner, motion: Motion, rows: npt.NDArray[np.int64],
    blocks: Sequence[npt.NDArray[np.int64]],
) -> float:  # fmt: skip
    """Return the skew with which the operator, bending its output, errs least; 0 where none does better.

    Found on a coarse grid, then between its neighbours; each half of the blocks is held out in turn.
    """
    halves = [np.concatenate(blocks[k::2]) for k in (0, 1)]

    def square(skew: float) -> float:
        tried = [_judged(plain.widths, p, skew, learner, motion, rows, halves) for p in ((), ("output",))]
        return min(c.typical for c in tried) ** 2

    at = min(_SKEWS, key=square)
    least, step = square(at), float(_SKEWS[1] - _SKEWS[0])
    while step > _FINEST:
        step /= 2.0
        for other in (at - step, at + step):
            if (found := square(other)) < least:
                at, least = other, found
    return round(float(at), 4) if least < (1.0 - LEAST_GAIN) ** 2 * square(0.0) else 0.0
