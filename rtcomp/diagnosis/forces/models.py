"""Friction that is believed as a model of the catalogue: one unit of the base, as large as it fits."""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.physics import Effect
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.physics.program import Program, run_chain
from rtcomp.physics.wires import COUNT, GRIP_LEVEL, MOVED, REACH, SCALE, STEP
from rtcomp.stage.stage import Stage


def own_models(stage: Stage) -> list[Effect]:
    """Return the model of friction that a stage believes in, where that is not of stop elements."""
    friction = stage.friction
    return [] if friction is None or isinstance(friction, MaxwellSlip) else [friction]


def levels(stage: Stage) -> Floats:
    """Return the level (N) of each of these, (0,) or (1,): what asks for the whole of friction is told so."""
    found = []
    for model in own_models(stage):
        program, w = Program([model]), np.zeros(COUNT)
        w[[REACH, SCALE, MOVED, STEP]] = 1.0
        run_chain(program.steps, program.p, program.s, w, 0, 1)
        found.append(float(w[GRIP_LEVEL]))
    return np.array(found)
