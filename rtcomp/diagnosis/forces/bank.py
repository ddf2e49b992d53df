"""Friction as columns: what each unit of it does along a motion, with what changes friction at work.

Units are the model of friction that is believed, where that is not of stop elements, and a stop element of
1 N/m for each reach. All go along the motion in one pass, the elements by the law of the catalogue's and not
by a call of it for each. What depends on the whole of friction (its level, how far it is along its branch) is
given that of the friction at hand, of which the units are parts: it stays linear.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis.forces.bending import bend, bent_sum
from rtcomp.diagnosis.forces.models import own_models
from rtcomp.kernels import Floats, compiled, summing
from rtcomp.physics import Effect
from rtcomp.physics.closing import ClosingBranches
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.physics.program import Program, renew, run_chain
from rtcomp.physics.softening import softened
from rtcomp.physics.wires import (
    COUNT,
    FRICTION,
    GRAIN,
    GRIP,
    GRIP_LEVEL,
    GRIP_STIFFNESS,
    MOVED,
    REACH,
    SCALE,
    SOFTENS,
)
from rtcomp.physics.yielding import stretched, without_noise, yielded
from rtcomp.stage.balance import along_row, parts_of
from rtcomp.stage.stage import Stage

AS_IT_IS = (1.0, 1.0)
"""Times its stiffness and its level, for what asks for the whole of friction."""
PARTS = 2
"""Parts of a row at least: where friction turns within one, the force at its ends is not that between."""


def units_along(
    stage: Stage,
    drive: Sequence[Effect],
    modifiers: Sequence[Effect],
    reaches: Floats,
    weights: Floats,
    motion: Floats,
    grain: float,
    start: Floats | None = None,
    sizes: Floats | None = None,
    larger: tuple[float, float] = AS_IT_IS,
    exponent: float = 0.0,
) -> Floats:
    """Return the force (N) of each unit around the rows of a motion, (K, models + reaches).

    With `sizes` of the stop elements, (reaches,), their sum times these instead of them: (K, models + 1).

    `motion` is (K, 5): time (s), position (m), velocity, acceleration, the command held up to each row (V);
    `weights` (N/m) of the elements make the friction at hand; what asks for the whole of it finds its
    stiffness and its level so many times `larger`. `start` (m) are the deflections of the elements before
    the motion, nothing where it is not given. `drive` effects only tell the load. A row is cut into PARTS,
    or more where an effect needs it. Elements yield by Dahl's law of an `exponent`, of 0 at once.
    """
    own = own_models(stage)
    models = MaxwellSlip.order
    chain = sorted(modifiers, key=lambda e: e.order)
    before = [*sorted(drive, key=lambda e: (e.place, e.order)), *(e for e in chain if e.order < models)]
    after = [e for e in chain if e.order > models]
    bending = [e for e in after if e.name == ClosingBranches.name]
    # One for the whole, and one for each element (or for their sum): the whole with a little more of that.
    bent = [e for e in bending for _ in range(1 + (len(reaches) if sizes is None else 1))]
    after = [e for e in after if e.name != ClosingBranches.name]
    program = Program([*before, *own, *bent, *after])
    row = float((motion[-1, 0] - motion[0, 0]) / max(motion.shape[0] - 1, 1))
    parts = max(parts_of([*before, *after], row), PARTS)
    times = weights if sizes is None else sizes
    mean = np.zeros((motion.shape[0], len(own) + (len(reaches) if sizes is None else 1)))
    w = np.zeros(COUNT)
    w[GRAIN] = grain
    base = np.array([stage.mass, stage.force_constant])
    deflection = np.zeros(len(reaches)) if start is None else start.copy()
    whole = bool(bent or after) or any(e.whole_friction for e in before)
    _along(
        program.steps, program.p, program.s, w, base, motion, parts, whole, len(before), len(own), len(bent),
        *larger, weights, reaches, exponent, deflection, sizes is not None, times, mean,
    )  # fmt: skip
    return mean


@compiled
def deflections(position: Floats, reaches: Floats, exponent: float, grain: float) -> Floats:
    """Return the deflections (m, (N,)) of elements after a motion (m, (K,)) of a `grain`, from nothing."""
    found, within = np.zeros(reaches.size), np.zeros(2)
    for k in range(1, position.size):
        moved = position[k] - position[k - 1]
        moved = moved if exponent == 0.0 else without_noise(within, 0, moved, grain)
        for i in range(reaches.size):
            found[i] = yielded(found[i], moved, reaches[i], exponent)
    return found


@compiled
def _along(
    steps: np.ndarray,
    p: Floats,
    s: Floats,
    w: Floats,
    base: Floats,
    motion: Floats,
    parts: int,
    whole: bool,
    first: int,
    own: int,
    bent: int,
    stiffer: float,
    higher: float,
    weights: Floats,
    reaches: Floats,
    exponent: float,
    deflection: Floats,
    summed: bool,
    times: Floats,
    mean: Floats,
) -> None:
    """Fill `mean` with forces around the rows: of `own` models of friction, the effects from `first` on.

    After them comes what each element holds, or so many `times`, `summed` up. Means over `parts` of the row
    before each row are weighed by what has passed of that, those over the row after it by what is to come.

    Where nothing changes or asks for the `whole` of friction, it is not summed up. After the models come
    `bent` effects that bend branches. What else changes the whole of friction is shared out among the
    elements in proportion to what each holds.
    """
    count = weights.size
    then = first + own
    level = stiffness = its_level = its_stiffness = 0.0
    for i in range(count):
        level += weights[i] * reaches[i]
        stiffness += stiffer * weights[i]
    level_asked = _total(times, reaches) if summed else 0.0
    here, last, held = np.zeros(mean.shape[1]), np.zeros(mean.shape[1]), np.empty(count)
    within = np.zeros(2)
    for k in range(motion.shape[0]):
        for j in range(1, parts + 1):
            along_row(w, motion, k, float(j), parts)
            renew(w, base[0], base[1])
            w[GRIP_LEVEL], w[GRIP_STIFFNESS] = higher * level + its_level, stiffness + its_stiffness
            run_chain(steps, p, s, w, 0, first)
            believed, its_level, its_stiffness = _believed(steps, p, s, w, first, own)
            if parts == 2 and not whole and not summed and w[SOFTENS] == exponent == 0.0:
                # Nothing asks what an element holds or changes it: it goes straight to the means.
                if own > 0:
                    here[0] = believed
                _share_out(mean, here[:own], last, k, j, parts)
                _move_and_share(w[MOVED], w[REACH], w[SCALE] / 3.0, reaches, deflection, mean, own, k, j)
                continue
            asked = 0.0
            if summed and w[SOFTENS] == exponent == 0.0:  # nobody asks what each element holds
                moved, longer = w[MOVED], w[REACH]
                total, asked = _stretched_sums(moved, longer, reaches, deflection, weights, times)
                total, asked = total * w[SCALE], asked * w[SCALE]
            else:
                moved = w[MOVED] if exponent == 0.0 else without_noise(within, 0, w[MOVED], w[GRAIN])
                _stretch(moved, w[REACH], w[SCALE], w[SOFTENS], reaches, exponent, deflection, held)
                total = _total(weights, held) if whole else 0.0
                asked = _total(times, held) if summed else 0.0
            grown = 1.0
            if whole:
                # The whole is what the chain sees from here on, and at the next step.
                w[GRIP], w[FRICTION] = total + believed, total + believed
                w[GRIP_LEVEL], w[GRIP_STIFFNESS] = level + its_level, stiffness + its_stiffness
                if bent > 0 and level > 0.0 and summed:
                    asked = bent_sum(steps, p, s, w, then, total, level, asked, level_asked)
                elif bent > 0 and level > 0.0:
                    bend(steps, p, s, w, then, total, level, weights, reaches, held)
                grown = _grown(steps, p, s, w, then + bent)
            _put(here, own, grown, believed, summed, asked, held)
            _share_out(mean, here, last, k, j, parts)


@compiled
def _believed(
    steps: np.ndarray, p: Floats, s: Floats, w: Floats, at: int, own: int
) -> tuple[float, float, float]:
    """Return force and level (N) and stiffness (N/m) of the model of friction at `at`, where there is one."""
    if own == 0:
        return 0.0, 0.0, 0.0
    w[FRICTION] = 0.0
    run_chain(steps, p, s, w, at, at + own)
    return w[FRICTION], w[GRIP_LEVEL], w[GRIP_STIFFNESS]


@compiled
def _put(
    here: Floats, own: int, grown: float, believed: float, summed: bool, asked: float, held: Floats
) -> None:
    """Put what friction holds, `grown` times as large."""
    if own > 0:
        here[0] = grown * believed
    if summed:
        here[own] = grown * asked
        return
    for i in range(held.size):
        here[own + i] = grown * held[i]


@summing
def _total(times: Floats, held: Floats) -> float:
    total = 0.0
    for i in range(held.size):
        total += times[i] * held[i]
    return total


@summing
def _stretched_sums(
    moved: float, longer: float, reaches: Floats, deflection: Floats, weights: Floats, times: Floats
) -> tuple[float, float]:
    """Move the stop elements on, and return the sums of their deflections by `weights` and by `times`."""
    total = asked = 0.0
    for i in range(reaches.size):
        deflection[i] = stretched(deflection[i], moved, reaches[i] * longer)
        total += weights[i] * deflection[i]
        asked += times[i] * deflection[i]
    return total, asked


@compiled
def _stretch(
    moved: float, longer: float, scale: float, softening: float, reaches: Floats, exponent: float,
    deflection: Floats, held: Floats,
) -> None:  # fmt: skip
    """Move the elements on: their `deflection` (m), and what they hold by it."""
    if exponent == 0.0:
        for i in range(reaches.size):
            deflection[i] = stretched(deflection[i], moved, reaches[i] * longer)
            held[i] = deflection[i] * scale
    else:
        for i in range(reaches.size):
            deflection[i] = yielded(deflection[i], moved, reaches[i] * longer, exponent)
            held[i] = deflection[i] * scale
    if softening != 0.0:
        for i in range(reaches.size):
            held[i] = softened(deflection[i], reaches[i] * longer, softening) * scale


@compiled
def _grown(steps: np.ndarray, p: Floats, s: Floats, w: Floats, first: int) -> float:
    """Return how many times larger the effects from `first` on make the whole of friction."""
    whole = w[FRICTION]
    run_chain(steps, p, s, w, first, steps[0])
    return float(w[FRICTION] / whole) if whole != 0.0 else 1.0


@compiled
def _share_out(mean: Floats, here: Floats, last: Floats, k: int, j: int, parts: int) -> None:
    """Add part `j` of row `k` to the mean forces around rows: `here` at its end, `last` at its beginning.

    What comes after the last row is taken to be as before it.
    """
    end = mean.shape[0] - 1
    if parts == 2:
        other = _other_row(k, j, end)
        for i in range(here.size):
            third = here[i] / 3.0
            mean[k, i] += third
            if other >= 0:
                mean[other, i] += third
        return
    passed = (j - 0.5) / parts
    for i in range(here.size):
        share = 0.5 * (last[i] + here[i]) / parts
        last[i] = here[i]
        mean[k, i] += passed * share
        if k > 0:
            mean[k - 1, i] += (1.0 - passed) * share
        if k == end:
            mean[k, i] += (1.0 - passed) * share


@compiled
def _other_row(k: int, j: int, end: int) -> int:
    """Return the row that half `j` of row `k` also counts in, -1 for none.

    Forces go along a parabola through both ends and the middle of a row, weighed by the triangle.
    """
    if j == 1:
        return k - 1
    return k if k == end else -1


@compiled
def _move_and_share(
    moved: float, longer: float, third: float, reaches: Floats, deflection: Floats, mean: Floats, stops: int,
    k: int, j: int,
) -> None:  # fmt: skip
    """Move the stop elements on, and add half `j` of row `k` to their means, columns from `stops` on.

    `third` is a third of the force that they hold for each metre (N/m).
    """
    row = mean[k, stops:]
    for i in range(reaches.size):
        deflection[i] = stretched(deflection[i], moved, reaches[i] * longer)
        row[i] += third * deflection[i]
    at = _other_row(k, j, mean.shape[0] - 1)
    if at >= 0:
        row = mean[at, stops:]
        for i in range(reaches.size):
            row[i] += third * deflection[i]
