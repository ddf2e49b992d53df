"""A skew: displacements count (1 + skew) times forward and (1 - skew) times backward.

They do so before they reach an operator, which is then stiffer in one direction, up to the same level. A
small loop does not close then: it ratchets towards the stiffer side until everything slides there, which
bounds it, and closes from then on. Motion back and forth within `grain`, the noise of the position, has no
direction: it would ratchet without end. A turn counts neither way until it has gone twice the grain; then it
was no noise, and all of the way since counts.
"""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats, compiled


@compiled
def beyond_grain(s: Floats, at: int, step: float, grain: float) -> float:
    """Return how far (m, either way) a step (m) goes beyond the grain (m), within which motion is noise.

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
    return float(abs(way))


@compiled
def as_skewed(inputs: Floats, skew: float, grain: float) -> Floats:
    """Return the motion (m, (K,)) that a symmetric operator must see to be one of such a skew (1)."""
    seen, state = inputs.copy(), np.zeros(2)
    for k in range(1, inputs.size):
        step = inputs[k] - inputs[k - 1]
        seen[k] = seen[k - 1] + step + skew * beyond_grain(state, 0, step, grain)
    return seen
