"""Which shape a hysteresis has: nested models judged on motion not learned from; the smallest that pays.

Each candidate learns the recorded motion sample by sample, one block of it left out in turn, and is judged
with frozen weights on that block; its memory sees all of the motion. What is chosen is the smallest model
whose error is not significantly above the best one's. A part that the motion says too little about is not
tried. The symmetric operator is always among the candidates.

Each shape is tried with the intervals of the configuration and with intervals placed by the motion itself
(`placed`), found anew without each block held out. Those are taken only where the others are significantly
worse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from rtcomp.hysteresis.basis import Basis, regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.learner import Learner
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.hysteresis.shaped import ShapedIntervalBasis
from rtcomp.hysteresis.skew import as_skewed
from rtcomp.jobs.shape.placed import Placed, placed
from rtcomp.kernels import Floats, call_learner, compiled

LADDER: tuple[tuple[str, ...], ...] = (
    (), ("output",), ("branches",), ("output", "branches"), ("reversible",), ("reversible", "output"),
    ("reversible", "position"), ("reversible", "position", "output"),
)  # fmt: skip
"""Parts tried, each alone and with a skew."""
BLOCKS = 6
ROWS_A_WEIGHT = 20
"""Updates needed for each weight that is learned."""
PLACED = "intervals placed"
LEAST_GAIN = 0.02
"""Share of its error that a larger model must take away, significant or not."""
PAYS = 0.25
"""Share of the symmetric operator's error that a shape must take away: beyond the motion it is less sure."""
_ALIKE, _MUCH = 0.05, 0.25
"""Logarithms of a ratio of errors up to which two are alike in a block, and from which one is much worse."""
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
    places: int = 0
    """Boundaries between intervals that the motion placed; 0 where they lie as configured."""

    @property
    def holds(self) -> str:
        """Say how many numbers were learned."""
        return f"{self.weights} weights" + (f" and {self.places} places" if self.places else "")

    @property
    def symmetric(self) -> bool:
        """Whether nothing is added to the symmetric operator, wherever its intervals lie."""
        return not self.parts and not self.skew

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
        added = [*([PLACED] if self.places else []), *self.parts]
        added += [f"skew {self.skew:+.3g}"] if self.skew else []
        return " + ".join(["symmetric", *added])


@dataclass(frozen=True)
class Choice:
    """The model that was chosen, learned on all of the motion, and what became of the others."""

    model: HysteresisModel
    chosen: Candidate
    information: Callable[[], Floats]
    """What the data say of each combination of its weights and offset, (size + 1, size + 1)."""
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
    return learned_with_state(basis, learner, x, force, rows)[0]


def learned_with_state(
    basis: Basis, learner: Learner, x: Floats, force: Floats, rows: npt.NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Return weights (size + 1,) learned row by row, and the learner's state then."""
    scales = np.append(basis.scales(), x[0, -1])
    w = np.zeros(x.shape[1])
    vector, state = learner.vector(scales), learner.initial_state(scales, basis.likeness())
    _learn_rows(learner.kernel.address, vector, state, x, force, rows, w)
    return w, state


def with_offset(basis: Basis, position: Floats) -> Floats:
    """Return the regressors (K, size + 1) along a motion, the last column the offset's constant (m)."""
    x = regressors(basis, position)
    return np.column_stack([x, np.full(position.size, basis.scales().mean())])


def significantly_worse(one: Candidate, other: Candidate) -> bool:
    """Tell whether the error of `one` is above that of `other` by more than chance, and by 2 % at least.

    Paired over the blocks held out, by the logarithm of the error, for blocks differ in how much moves in
    them: one-sided 95 %, or in every block (sign test). Or where a block tells them apart that has a motion
    which the others have not, as the growing first one: there it is much worse, and nowhere is it better.
    """
    worse = 0.5 * np.log(np.maximum(one.squares, 1e-300) / np.maximum(other.squares, 1e-300))
    count = worse.size
    doubt = _T.get(count, 1.8) * float(worse.std(ddof=1)) / np.sqrt(count) if count > 1 else 0.0
    always = count >= _SIGNS and bool((worse > 0.0).all())
    nowhere_better = count > 1 and bool(worse.min() > -_ALIKE and worse.max() > _MUCH)
    return bool(worse.mean() > (LEAST_GAIN if always or nowhere_better else max(doubt, LEAST_GAIN)))


def smallest_that_pays(candidates: Sequence[Candidate]) -> int:
    """Return the index of the candidate with the fewest weights not significantly worse than the best.

    What is added to the symmetric operator must take away `PAYS` of its error. One with a skew, which may
    ratchet, is taken where all that cannot are significantly worse. This with intervals as configured; with
    those that were placed it is sought by itself, and taken only where the other is significantly worse. All
    at once, many candidates more would make more of chance.
    """
    found = {}
    for lie in (False, True):
        own = [i for i, c in enumerate(candidates) if bool(c.places) == lie]
        plain = min((candidates[i].typical for i in own if candidates[i].symmetric), default=np.inf)
        own = [i for i in own if candidates[i].symmetric or candidates[i].typical <= (1.0 - PAYS) * plain]
        own.sort(key=lambda i: (bool(candidates[i].skew), candidates[i].weights))
        if own:
            best = min((candidates[i] for i in own), key=lambda c: c.typical)
            found[lie] = next(i for i in own if not significantly_worse(candidates[i], best))
    if len(found) == 2 and not significantly_worse(candidates[found[False]], candidates[found[True]]):
        return found[False]
    return found[max(found)]


def choose(plain: IntervalBasis, learner: Learner, motion: Motion, blocks: int = BLOCKS) -> Choice:
    """Try the ladder of models over the intervals of `plain` on a recorded motion and choose.

    Notes say what was left off, and why. Nothing is raised for little data: the symmetric operator is left.
    """
    rows = gated(motion)
    parts_of_time = np.array_split(rows, blocks)
    left: list[str] = []
    tried: list[Candidate] = []
    skew = _best_skew(plain, learner, motion, rows, parts_of_time) if rows.size >= needed(plain.size) else 0.0
    amounts, ends = tuple(dict.fromkeys((0.0, skew))), plain.size - 1
    lies = {(0, amount): Placed(plain.widths, (plain.widths,) * blocks) for amount in amounts}
    unmoved = ""
    for amount in amounts if ends and rows.size >= needed(plain.size + ends) else ():
        moved = _placed(plain, learner, motion, amount, parts_of_time)
        if isinstance(moved, Placed):
            lies[ends, amount] = moved
        else:
            unmoved = unmoved or moved
    for parts in LADDER:
        for places in dict.fromkeys((0, ends)):
            size = ShapedIntervalBasis(plain.widths, parts).size + places
            if (parts or places) and rows.size < needed(size):
                left.append(f"{' + '.join([*([PLACED] if places else []), *parts])} ({needed(size)})")
                break
            for amount in amounts:
                if (at := lies.get((places, amount))) is not None:
                    judged = _judged(at.without, parts, amount, learner, motion, rows, parts_of_time)
                    tried.append(replace(judged, places=places))
    chosen = tried[smallest_that_pays(tried)]
    widths = lies[chosen.places, chosen.skew].widths
    found, w, state = _fitted(widths, chosen.parts, chosen.skew, learner, motion, rows)
    notes = [_verdict(chosen, tried)]
    if len(lies) > len(amounts):
        notes.append(_of_places(chosen, tried, plain.widths, widths))
    elif unmoved:
        notes.append(f"intervals lie as configured: {unmoved}")
    if left:
        notes.append(left_off(rows.size, left))
    scales = np.append(found.scales(), found.scales().mean())
    model = HysteresisModel(found, w[:-1], float(w[-1] * scales[-1]))
    return Choice(model, chosen, lambda: learner.information(state, scales), tried, notes)


def left_off(updates: int, left: Sequence[str]) -> str:
    """Say what was left off for want of data, each with how many updates it takes."""
    return (
        f"left off for want of data, {updates} updates: {', '.join(left)}, in brackets how many it takes; "
        "record longer, make identify.gate smaller, or take fewer intervals"
    )


def _verdict(chosen: Candidate, tried: Sequence[Candidate]) -> str:
    best, plain = min(tried, key=lambda c: c.rms), tried[0]
    says = f"model {chosen}: held-out error {chosen.rms:.3g} N"
    if chosen is not plain:
        says += f", the symmetric operator's {plain.rms:.3g} N"
    if best is not chosen:
        says += f"; {best} has {best.rms:.3g} N with {best.holds} for {chosen.holds}: does not pay"
    return says


def _of_places(chosen: Candidate, tried: Sequence[Candidate], before: Floats, after: Floats) -> str:
    """Say what placing the intervals of the chosen shape did, or would have done."""
    if chosen.places:
        return (
            f"{PLACED} where the curve bends, {after.min():.3g} to {after.max():.3g} m wide; identify has "
            f"them {before.min():.3g} to {before.max():.3g} m"
        )
    same = [c for c in tried if c.places and c.parts == chosen.parts and c.skew == chosen.skew]
    if not same:
        return f"intervals lie as configured: placed ones were not tried with {chosen}"
    error = f"{same[0].rms:.3g} N, {chosen.rms:.3g} N as they lie"
    return f"intervals lie as configured: to place them does not pay, held-out error {error}"


def _placed(
    plain: IntervalBasis, learner: Learner, motion: Motion, skew: float,
    blocks: Sequence[npt.NDArray[np.int64]],
) -> Placed | str:  # fmt: skip
    """Place the intervals on the motion as an operator of such a skew sees it, or say why they are not."""
    seen = as_skewed(motion.position, skew, motion.grain) if skew else motion.position
    return placed(plain, learner, seen, motion.force, motion.good, motion.gate, blocks)


def needed(weights: int) -> int:
    """Return how many updates it takes to learn so many weights."""
    return ROWS_A_WEIGHT * weights


def gated(motion: Motion) -> npt.NDArray[np.int64]:
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
) -> tuple[Basis, Floats, Floats]:  # fmt: skip
    """Return the basis, the shape of its output as learned, its weights, and the state of the learner."""
    if not parts and not skew:
        plain = IntervalBasis(widths)
        return plain, *learned_with_state(
            plain, learner, with_offset(plain, motion.position), motion.force, rows
        )
    grain = motion.grain if skew else 0.0
    basis = ShapedIntervalBasis(widths, parts, skew=skew, grain=grain)
    w, state = learned_with_state(basis, learner, with_offset(basis, motion.position), motion.force, rows)
    for _ in range(_ROUNDS if basis.takes_shape else 0):
        slopes = w[: widths.size]
        if not float(slopes @ widths) > 0.0:
            break
        basis = basis.changed(shape=slopes)
        w, state = learned_with_state(basis, learner, with_offset(basis, motion.position), motion.force, rows)
    return basis, w, state


def _judged(
    widths: Sequence[Floats], parts: tuple[str, ...], skew: float, learner: Learner, motion: Motion,
    rows: npt.NDArray[np.int64], blocks: Sequence[npt.NDArray[np.int64]],
) -> Candidate:  # fmt: skip
    """Judge a model on each of the blocks, held out in turn; `widths` (m, (N,)) of its intervals for each."""
    squares = []
    for own, block in zip(widths, blocks, strict=True):
        basis, w, _ = _fitted(own, parts, skew, learner, motion, np.setdiff1d(rows, block))
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
        tried = [
            _judged([plain.widths] * 2, p, skew, learner, motion, rows, halves) for p in ((), ("output",))
        ]
        return min(c.typical for c in tried) ** 2

    at = min(_SKEWS, key=square)
    least, step = square(at), float(_SKEWS[1] - _SKEWS[0])
    while step > _FINEST:
        step /= 2.0
        for other in (at - step, at + step):
            if abs(other) <= _SKEWS[-1] and (found := square(other)) < least:
                at, least = other, found
    return round(float(at), 4) if least < (1.0 - LEAST_GAIN) ** 2 * square(0.0) else 0.0
