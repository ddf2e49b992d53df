"""A skew: displacements count (1 + skew) times forward and (1 - skew) times backward.

They do so before they reach an operator, which is then stiffer in one direction, up to the same level. A
small loop does not close then: it ratchets towards the stiffer side until everything slides there, which
bounds it, and closes from then on. Motion back and forth within `grain`, the noise of the position, has no
direction: it would ratchet without end. A turn counts neither way until it has gone twice the grain; then it
was no noise, and all of the way since counts.
"""

from __future__ import annotations

import numpy as np

from rtcomp.grain import beyond_grain
from rtcomp.kernels import Floats, compiled


@compiled
def as_skewed(inputs: Floats, skew: float, grain: float) -> Floats:
    """Return the motion (m, (K,)) that a symmetric operator must see to be one of such a skew (1)."""
    seen, state = inputs.copy(), np.zeros(2)
    for k in range(1, inputs.size):
        step = inputs[k] - inputs[k - 1]
        seen[k] = seen[k - 1] + step + skew * abs(beyond_grain(state, 0, step, grain))
    return seen
