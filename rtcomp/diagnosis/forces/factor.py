"""By how much an effect makes friction larger, whatever friction there is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.physics import Effect
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.stage.balance import forces

if TYPE_CHECKING:
    from rtcomp.diagnosis.forces.signals import Signals

SLIDES = 1e-3
"""Yield displacement of friction that hardly ever sticks, in grains of the sensor."""


def larger_by(signals: Signals, effect: Effect) -> list[Floats]:
    """Return the part by which friction is larger beside an effect, (K,) a segment; 0 where it sticks.

    Measured on friction that hardly ever sticks, of 1 N/m: of 1 N, it would be stiffer than any stage is.
    """
    reach = SLIDES * signals.grain
    sliding: list[Effect] = [MaxwellSlip([(1.0, reach)])]
    found = []
    for segment, path in zip(signals.data.segments, signals.paths(), strict=True):
        motion = segment.time, path.x, path.v, path.a, signals.given(segment)
        held = [
            np.abs(forces(signals.stage, chain, *motion, signals.grain).friction)
            for chain in ([effect, *sliding], sliding)
        ]
        found.append((held[0] - held[1]) / reach)
    return found
