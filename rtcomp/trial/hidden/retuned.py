"""The believed physics with other values: to be retuned, not to be named."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rtcomp.trial.hidden.secret import Rig, Secret, Size, Sized, either


def _factor(slot: str, typical: float) -> Callable[[np.random.Generator, Rig], Sized]:
    def draw(chance: np.random.Generator, rig: Rig) -> Sized:
        sign, believed = either(chance), float(getattr(rig.physics, slot))

        def at(strength: float) -> Size:
            return {slot: believed * (1.0 + typical * strength) ** sign}, {}

        return Sized(at, 0.4, 4.0)

    return draw


RETUNED = (
    Secret("retuned-friction-level", _factor("level", 0.3), retuning=True),
    Secret("retuned-friction-reach", _factor("reach", 0.5), retuning=True),
    Secret("retuned-viscous", _factor("viscous", 1.0), retuning=True),
    Secret("retuned-mass", _factor("mass", 0.3), retuning=True),
    Secret("retuned-force-constant", _factor("force_constant", 0.3), retuning=True),
)
