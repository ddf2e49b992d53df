"""Motion within the grain of a sensor, which is its noise."""

from __future__ import annotations

from rtcomp.kernels import Floats, compiled


@compiled
def beyond_grain(s: Floats, at: int, step: float, grain: float) -> float:
    """Return how far (m) a step (m) goes beyond the grain (m), within which motion is noise.

    s[at]: the place within the grain (m); s[at + 1]: the direction of motion beyond it (1; 0 before there was
    any). A turn that goes twice the grain was no noise: it counts from where it began.
    """
    inside = s[at] + step
    s[at] = min(max(inside, -grain), grain)
    way = inside - s[at]
    if way == 0.0:
        return 0.0
    direction = 1.0 if way > 0.0 else -1.0
    if s[at + 1] != direction:
        way += direction * (grain - s[at + 1] * direction * grain)
        s[at + 1] = direction
    return float(way)
