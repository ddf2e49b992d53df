"""How the level of friction grows: contacts slide later, get stiffer, or bear more where they stand."""

from __future__ import annotations

from typing import Final

from rtcomp.kernels import Floats, compiled
from rtcomp.physics.effect import Parameter
from rtcomp.physics.wires import MOVED, REACH, SCALE

STIFFENING = Parameter(
    "stiffening", "1", 0.0, 1.0, "1: contacts that hold more are stiffer, 0: they only hold more", 0.0
)
FOLLOWING = Parameter(
    "following",
    "1",
    0.0,
    1.0,
    "1: what sticks follows the level at once; as much as it stiffens, if less",
    0.0,
)
GROWTH = (STIFFENING, FOLLOWING)
LEAST: Final = 1e-3
"""Smallest factor on the level (1): friction never drives."""


@compiled
def grow(w: Floats, factor: float, midway: float, stiffening: float, following: float) -> None:
    """Multiply the level of friction by `factor`, its stiffness by factor^stiffening.

    `factor` is that at the end of the step, where the force is; `midway` that of the step's middle, under
    which its displacement is made: the same where it hardly changes within a step.
    The force of what sticks is multiplied at once by factor^following; what is left of the level comes with
    further motion. Contacts whose stiffness grows bear more where they stand: they follow at least as much.
    """
    if stiffening == 0.0 and following == 0.0:
        w[REACH] *= factor
        return
    follows = max(following, stiffening)
    w[SCALE] *= factor**follows
    w[MOVED] *= midway ** (stiffening - follows)
    w[REACH] *= factor ** (1.0 - follows)
