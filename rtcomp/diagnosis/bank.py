"""Friction as columns: what each unit of the base does along a motion, with what changes friction at work.

Units are viscous friction and micro-damping of size 1, and a stop element of 1 N/m for each reach. All go
through the kernels of the catalogue in one pass. What depends on the whole of friction (its level, how far
it is along its branch) is given that of the friction at hand, of which the units are parts: it stays linear.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.physics import Effect
from rtcomp.physics.closing import ClosingBranches
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.physics.program import Program, renew, run_chain
from rtcomp.physics.speed import MicroDamping, ViscousFriction
from rtcomp.physics.wires import COUNT, FRICTION, GRAIN, GRIP, GRIP_LEVEL, GRIP_STIFFNESS
from rtcomp.stage.balance import along_row
from rtcomp.stage.stage import Stage

SPEED_UNITS = 2
"""Units before the stop elements: viscous friction, micro-damping."""


def units_along(
    stage: Stage,
    drive: Sequence[Effect],
    modifiers: Sequence[Effect],
    reaches: Floats,
    weights: Floats,
    motion: Floats,
    grain: float,
) -> Floats:
    """Return the force (N) of each unit along a motion, (K, 2 + reaches).

    `motion` is (K, 5): time (s), position (m), velocity, acceleration, the command held up to each row (V);
    `weights` (N/m) of the stop elements make the friction at hand. `drive` effects only tell the load.
    """
    units: list[Effect] = [
        ViscousFriction(coefficient=1.0),
        MicroDamping(coefficient=1.0, speed=stage.mechanics.micro_damping_speed),
        *(MaxwellSlip([(1.0, float(r))]) for r in reaches),
    ]
    models = units[-1].order
    chain = sorted(modifiers, key=lambda e: e.order)
    before = [*sorted(drive, key=lambda e: (e.place, e.order)), *(e for e in chain if e.order < models)]
    after = [e for e in chain if e.order > models]
    program = Program([*before, *units, *after])
    row = float((motion[-1, 0] - motion[0, 0]) / max(motion.shape[0] - 1, 1))
    longest = min((e.longest_step() for e in [*before, *after]), default=math.inf)
    parts = max(math.ceil(row / longest - 1e-9), 1)
    out = np.empty((motion.shape[0], len(units)))
    w = np.zeros(COUNT)
    w[GRAIN] = grain
    base = np.array([stage.mass, stage.force_constant])
    first = len(before), len(before) + SPEED_UNITS
    adding = sum(1 for e in after if e.name == ClosingBranches.name)
    _along(program.steps, program.p, program.s, w, base, motion, parts, *first, adding, weights, reaches, out)
    return out


@compiled
def _along(
    steps: np.ndarray,
    p: Floats,
    s: Floats,
    w: Floats,
    base: Floats,
    motion: Floats,
    parts: int,
    first: int,
    elements: int,
    adding: int,
    weights: Floats,
    reaches: Floats,
    out: Floats,
) -> None:
    """Fill `out`; units are the effects from `first` on, stop elements those from `elements` on.

    What changes the whole of friction is shared out among the stop elements: of the first `adding` such
    effects by their level, for what those add is there while friction passes through zero too; of the others
    in proportion to what each holds.
    """
    count = weights.size
    level = stiffness = 0.0
    for i in range(count):
        level += weights[i] * reaches[i]
        stiffness += weights[i]
    for k in range(motion.shape[0]):
        for j in range(1, parts + 1):
            along_row(w, motion, k, j, parts)
            renew(w, base[0], base[1])
            w[GRIP_LEVEL], w[GRIP_STIFFNESS] = level, stiffness
            run_chain(steps, p, s, w, 0, first)
            total = 0.0
            for i in range(first, elements + count):
                w[FRICTION] = 0.0
                run_chain(steps, p, s, w, i, i + 1)
                out[k, i - first] = w[FRICTION]
                if i >= elements:
                    total += weights[i - elements] * w[FRICTION]
            # The whole is what the chain sees from here on, and at the next step.
            w[GRIP], w[GRIP_LEVEL], w[GRIP_STIFFNESS] = total, level, stiffness
            w[FRICTION] = total
            after = elements + count
            run_chain(steps, p, s, w, after, after + adding)
            added, whole = w[FRICTION] - total, w[FRICTION]
            run_chain(steps, p, s, w, after + adding, steps[0])
            for i in range(elements - first, out.shape[1]):
                if added != 0.0:
                    out[k, i] += added * reaches[i - elements + first] / level
                if whole != 0.0:
                    out[k, i] *= w[FRICTION] / whole
