"""The micrometre stage, of which little is believed: no friction, another shape of it, or wrong numbers."""

from __future__ import annotations

import numpy as np

from rtcomp.trial.axis import Physics
from rtcomp.trial.families.family import NO_FRICTION_VALUES, Family
from rtcomp.trial.families.micrometre import draw_stage
from rtcomp.trial.friction import ELEMENTS
from rtcomp.trial.stagefile import Believed

FAR_OFF = 0.2
"""Part by which the numbers are off at most."""


def belief(physics: Physics, chance: np.random.Generator) -> Believed:
    """Draw a belief: without friction, with another shape of it, or off by up to a fifth."""
    kind = chance.choice(["minimal", "shape", "far"])
    off = 1.0 + FAR_OFF * chance.uniform(-1.0, 1.0, 6)
    shape, longer = chance.uniform(1.0, 1.5), chance.uniform(0.4, 1.6)
    count = int(chance.choice([1, 2, 4]))
    if kind == "minimal":
        return Believed(physics._replace(mass=physics.mass * off[0], viscous=0.0, micro_damping=0.0), ())
    if kind == "shape":
        wrong = physics._replace(reach=physics.reach * longer, shape=shape, micro_damping=0.0)
        return Believed(wrong, (1.0,) * count)
    wrong = physics._replace(
        mass=physics.mass * off[0], viscous=physics.viscous * off[1],
        micro_damping=physics.micro_damping * off[2], reach=physics.reach * off[3],
    )  # fmt: skip
    return Believed(wrong, (float(off[4]),) * ELEMENTS)


FAMILY = Family(
    "thin-belief", "micrometre stage; no friction, another shape or numbers off by a fifth are believed",
    draw_stage, belief=belief, forms=0.0,
    # Other values of what is hardly believed are no effects; a lag needs a Stribeck effect that is known.
    lacks=NO_FRICTION_VALUES | {
        "drive-gain", "inertia", "viscous-friction", "back-emf", "frictional-lag", "retuned-viscous",
    },
)  # fmt: skip
