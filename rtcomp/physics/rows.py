"""Run a chain of effects over rows of wires: over a recording, a reference, a test's motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.physics.effect import Effect
from rtcomp.physics.program import Program, run_chain
from rtcomp.physics.wires import (
    BEHIND,
    COUNT,
    GAIN,
    GRIP,
    MASS,
    MOVED,
    POSITION,
    REACH,
    SCALE,
    SENSED,
    STEP,
    TIME,
    VELOCITY,
    VOLTS,
)  # fmt: skip


@compiled
def _over_rows(steps: np.ndarray, p: Floats, s: Floats, rows: Floats) -> None:
    for k in range(rows.shape[0]):
        if k > 0:  # what stays from step to step
            rows[k, GRIP : BEHIND + 1] = rows[k - 1, GRIP : BEHIND + 1]
        run_chain(steps, p, s, rows[k], 0, steps[0])


def over_rows(chain: Sequence[Effect], rows: Floats) -> Floats:
    """Run `chain`, in the order given and from its virgin state, over `rows` in place and return them.

    `rows` has one row a step and one column a wire (shape (n, wires.COUNT), float64, C order), filled with
    what the effects read; they write into the same rows. Use `new_rows` to make them. Raises TypeError for
    arrays of another kind.
    """
    if rows.dtype != np.float64 or not rows.flags.c_contiguous or rows.ndim != 2 or rows.shape[1] != COUNT:
        raise TypeError(f"rows must be a C-ordered float64 array of shape (n, {COUNT}); it is {rows.shape}")
    program = Program(chain)
    _over_rows(program.steps, program.p, program.s, rows)
    return rows


def new_rows(count: int) -> Floats:
    """Return `count` rows of wires in which nothing acts: factors 1, everything else 0."""
    rows = np.zeros((count, COUNT))
    rows[:, [REACH, SCALE, MASS, GAIN]] = 1.0
    return rows


def motion_rows(position: Floats, step: float, volts: Floats | float = 0.0) -> Floats:
    """Return rows that follow `position` (m, shape (n,)) from 0, one every `step` seconds, at `volts`.

    Each step is made at constant speed, its displacement over its length, without acceleration; the mass is
    1 kg, the force constant 1 N/V.
    """
    rows = new_rows(len(position))
    rows[:, TIME] = step * np.arange(1, len(position) + 1)
    rows[:, STEP] = step
    rows[:, POSITION] = rows[:, SENSED] = position
    rows[:, MOVED] = np.diff(position, prepend=0.0)
    rows[:, VELOCITY] = rows[:, MOVED] / step
    rows[:, VOLTS] = volts
    return rows
