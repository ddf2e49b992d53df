"""Shapes of what repeats along the stroke: a sine, and a triangle with the same zeros and peaks."""

from __future__ import annotations

import math
from typing import Final

from rtcomp.kernels import compiled
from rtcomp.physics.effect import Parameter

PERIOD = Parameter("period", "m", 0.0, 1e6, "length after which it repeats", open_low=True)
PHASE = Parameter("phase", "rad", -100.0, 100.0, "angle at position zero", 0.0)
SINE, TRIANGLE = "sine", "triangle"
"""Names of the forms."""
_TO_ONE: Final = 2.0 / math.pi


@compiled
def triangle(angle: float) -> float:
    """Return the triangle that is 0, 1, 0, -1 where the sine of the angle (rad) is."""
    return _TO_ONE * math.asin(math.sin(angle))
