"""How an element of friction yields: at its reach at once, or nearing it as Dahl's solid does."""

from __future__ import annotations

import math

from rtcomp.grain import beyond_grain
from rtcomp.kernels import Floats, compiled

NO_TURN = 2.0
"""Grains within which what yields as a solid sees no turn: of white noise one of a few hundred rows is beyond
(three deviations), and each turn makes it forget a part of its force."""
LEAST_GAP = 1e-200
"""A gap that counts as none: its powers would leave the range of floats."""


@compiled
def stretched(deflection: float, moved: float, reach: float) -> float:
    """Return the deflection (m) of a stop element after it was `moved`: exact, however far."""
    return min(max(deflection + moved, -reach), reach)


@compiled
def neared(gap: float, travel: float, exponent: float) -> float:
    """Return what is left of the gap to a level, both in levels, after a `travel` in stiffness over level.

    Dahl's equation in the gap u, du/ds = -|u|^i sgn(u), has a closed form for every exponent i, so that a
    displacement of any size is exact.
    """
    size = abs(gap)
    if exponent == 1.0:
        left = size * math.exp(-travel)
    elif size < LEAST_GAP:
        left = 0.0
    else:
        # Relative to the starting gap, so that no power of a tiny gap overflows.
        shrink = 1.0 - (1.0 - exponent) * travel * math.exp((exponent - 1.0) * math.log(size))
        left = size * math.exp(math.log(shrink) / (1.0 - exponent)) if shrink > 0.0 else 0.0
    return math.copysign(left, gap)


@compiled
def yielded(deflection: float, moved: float, reach: float, exponent: float) -> float:
    """Return the deflection (m) of an element that yields by Dahl's law; of exponent 0, of a stop element."""
    if exponent == 0.0:
        return stretched(deflection, moved, reach)
    if moved == 0.0:
        return deflection
    way = math.copysign(1.0, moved)
    return way * reach * (1.0 - neared(1.0 - way * deflection / reach, abs(moved) / reach, exponent))


@compiled
def without_noise(s: Floats, at: int, moved: float, grain: float) -> float:
    """Return how far (m) something that forgets in every small loop was `moved`, noise of a reading left out.

    s[at]: place within the grain (m); s[at + 1]: direction of motion beyond it (`beyond_grain`).
    """
    return beyond_grain(s, at, moved, NO_TURN * grain)
