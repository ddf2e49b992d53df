"""Where the intervals would lie if they placed themselves on a recorded motion, without a part held out.

Places are found as the loop finds them with ``model: self-placing``: sample by sample, offset and all. While
what is held out passes, only the operator's memory goes on, so that places know no force they are judged on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.learner import Learner, learn_places
from rtcomp.hysteresis.moving.self_placing import SelfPlacingBasis
from rtcomp.kernels import Floats


@dataclass(frozen=True)
class Placed:
    """Widths (m) of intervals that placed themselves, (N,) each."""

    widths: Floats
    """On all of the motion."""
    without: tuple[Floats, ...]
    """On all but each block held out."""


def placed(
    plain: IntervalBasis,
    learner: Learner,
    position: Floats,
    force: Floats,
    good: npt.NDArray[np.bool_],
    gate: float,
    blocks: Sequence[npt.NDArray[np.int64]],
) -> Placed | str:
    """Place the intervals of `plain` on a motion, position (m) and force (N), (K,); or say why they are not.

    Rows count where `good` (K,); `gate` (m): of motion between two updates. `blocks`: rows held out in turn,
    in their order; all that lies between their first and last is held out with them.
    """

    def found(counted: npt.NDArray[np.bool_]) -> Floats:
        basis = SelfPlacingBasis(plain.widths)
        settled, _ = learn_places(basis, learner, position, force, gate, counted, offset=True)
        assert isinstance(settled, IntervalBasis)
        return settled.widths

    try:
        every = found(good)
    except ConfigError as error:
        return str(error)
    if np.allclose(every, plain.widths, rtol=1e-9, atol=0.0):
        return "they stay where they are when they may move"
    without = []
    for block in blocks:
        counted = good.copy()
        if block.size:
            counted[block[0] : block[-1] + 1] = False
        without.append(found(counted))
    return Placed(every, tuple(without))
