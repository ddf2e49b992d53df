"""What a little more of each stop element does to a whole of friction whose branches are bent."""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.physics.program import run_chain
from rtcomp.physics.wires import FRICTION, GRIP, GRIP_LEVEL

MORE = 1e-4
"""Part of the level that an element is made larger by, to see what it does to bent branches."""


@compiled
def bend(
    steps: np.ndarray,
    p: Floats,
    s: Floats,
    w: Floats,
    first: int,
    total: float,
    level: float,
    weights: Floats,
    reaches: Floats,
    held: Floats,
) -> None:
    """Put into `held` (N/(N/m)) of each stop element what a little more of it does to the bent whole.

    The bent force is in proportion to all weights together, so their products with these sum up to it, and a
    fit of them converges even where its branches are far from those of the weights at hand. The effect
    `first` bends the whole, `total` (N) at `level` (N); those after it the whole with more of one element.
    """
    count = weights.size
    whole = rest = _bent(steps, p, s, w, first, total, level)
    for i in range(count):
        more = MORE * level / reaches[i]
        larger = _bent(steps, p, s, w, first + 1 + i, total + more * held[i], level + more * reaches[i])
        held[i] = (larger - whole) / more
        rest -= weights[i] * held[i]
    for i in range(count):  # what is missing of the whole is the rounding of these differences
        held[i] += rest * reaches[i] / level
    w[GRIP], w[GRIP_LEVEL], w[FRICTION] = whole, level, whole


@compiled
def bent_sum(
    steps: np.ndarray,
    p: Floats,
    s: Floats,
    w: Floats,
    first: int,
    total: float,
    level: float,
    asked: float,
    level_asked: float,
) -> float:
    """Return the sum of what `bend` puts into elements, so many times each as make `asked` (N) unbent."""
    whole = _bent(steps, p, s, w, first, total, level)
    more = MORE * level / max(abs(level_asked), level)
    other = total + more * (asked - total), level + more * (level_asked - level)
    larger = _bent(steps, p, s, w, first + 1, other[0], other[1])
    w[GRIP], w[GRIP_LEVEL], w[FRICTION] = whole, level, whole
    return float(whole + (larger - whole) / more)


@compiled
def _bent(steps: np.ndarray, p: Floats, s: Floats, w: Floats, at: int, force: float, level: float) -> float:
    """Return a friction `force` (N) of this `level` (N) as the effect number `at` bends it."""
    w[GRIP], w[GRIP_LEVEL], w[FRICTION] = force, level, force
    run_chain(steps, p, s, w, at, at + 1)
    return float(w[GRIP])
