"""The tick: read, check, identify, compensate, limit, write, hand over to the ring. Once, for every clock.

Its arithmetic is one compiled kernel (`kernel`) on preallocated arrays; nothing is allocated while it runs.
What changes from tick to tick without depending on the measurement (references, forces known beforehand, when
to learn, how much feedforward) comes from a plan: a table with one row a tick.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rtcomp.hysteresis.basis import Basis, regressors
from rtcomp.hysteresis.conditioning import memory
from rtcomp.hysteresis.learner import Learner, followed
from rtcomp.hysteresis.moving.places import CHANGE_WIDTH, MOVES
from rtcomp.kernels import Floats
from rtcomp.loop import layout as at
from rtcomp.loop.kernel import Compensator, Identifier, lost_kernel, tick_kernel
from rtcomp.loop.layout import (
    COLUMNS,
    FEEDFORWARD,
    KNOWN,
    LEAD_FORCE,
    LEAD_POSITION,
    LEARN,
    LET_GO,
    PLAN_WIDTH,
    REFERENCE,
    VOLTS,
)
from rtcomp.loop.states import State

__all__ = [
    "COLUMNS",
    "FEEDFORWARD",
    "KNOWN",
    "LEAD_FORCE",
    "LEAD_POSITION",
    "LEARN",
    "LET_GO",
    "PLAN_WIDTH",
    "REFERENCE",
    "VOLTS",
    "Compensator",
    "Identifier",
    "Tick",
    "TickSettings",
    "lost_kernel",
    "tick_kernel",
]


class TickSettings(NamedTuple):
    """What a tick needs to know of the axis and of how to learn. SI units."""

    period: float
    force_constant: float
    mass: float = 0.0
    viscous: float = 0.0
    gate: float = 0.0
    travel: tuple[float, float] = (-math.inf, math.inf)
    speed: float = math.inf
    delay_ticks: int = 0
    closed_loop: bool = True
    jump: float = math.inf
    """m: second difference of position beyond which no force explains a sample."""
    one_count: float = 0.0
    """m: what a position may flicker by without having moved."""
    stuck_volts: float = math.inf
    """V at which the axis must move, and for how many ticks it need not."""
    stuck_ticks: float = math.inf
    sign_volts: float = math.inf
    """V by which the axis must go their way; ticks of each of the two windows in which it does not."""
    sign_ticks: int = 8
    age_ticks: float = math.inf
    """Ticks in a row without a new sample that are put up with."""
    invalid_ticks: float = math.inf
    """Ticks in a row with a position that must not be used that are put up with."""
    late: float = 0.5
    """Share of the period from which a tick counts as late for the pace; `overrun` flags earlier ones."""
    slots_lost: float = math.inf
    """Slots lost and not forgiven that are a fault."""
    device_paced: bool = False
    force_bound: float = math.inf
    """N: a model that says more has diverged."""


class Tick:
    """All arrays of one loop, allocated beforehand; calling it runs the kernel on one sample.

    `weights` (size of basis + 1, the last the offset in N per m of the mean width) are taken as a start;
    `sections` are the conditioning filter's (hysteresis.conditioning.low_pass).
    """

    def __init__(
        self,
        settings: TickSettings,
        basis: Basis,
        learner: Learner,
        *,
        sections: Floats,
        pid: tuple[Floats, Floats],
        limits: tuple[Floats, Floats],
        weights: Floats | None = None,
        learn_offset: bool = True,
    ) -> None:
        n = basis.size
        scales = basis.scales()
        offset_scale = float(scales.mean()) if learn_offset else 0.0
        all_scales = np.append(scales, offset_scale if learn_offset else float(scales.mean()))
        self.columns: Sequence[str] = COLUMNS
        self.weights: Floats = np.zeros(n + 1)
        if weights is not None:
            self.weights[:] = weights
        self.offset_scale = offset_scale
        self.basis, self.learner, self.scales = basis, learner, all_scales
        x, lead_x = np.zeros(n + 1), np.zeros(n + 1)
        x[n] = lead_x[n] = offset_scale
        moving, follow = followed(basis, learner)
        begun = learner.initial_state(all_scales, basis.likeness())
        self.identifier = Identifier(
            basis.kernel.address, basis.vector(), basis.initial_state(), x,
            learner.kernel.address, learner.vector(all_scales), begun,
            self.weights, sections, memory(sections), memory(sections),
            begun.copy(), self.weights.copy(), all_scales,
            moving, basis.memory(settings.gate), np.zeros(CHANGE_WIDTH), follow,
        )  # fmt: skip
        self.compensator = Compensator(basis.initial_state(), lead_x, *pid, *limits)
        s = settings
        self.settings: Floats = np.array(
            [
                s.period, s.force_constant, s.mass, s.viscous, s.gate, s.travel[0], s.travel[1], s.speed,
                s.delay_ticks, offset_scale, float(s.closed_loop), s.jump, s.one_count, s.stuck_volts,
                s.stuck_ticks, s.sign_volts, s.sign_ticks, s.age_ticks, s.invalid_ticks,
                1e6 * s.late * s.period, s.slots_lost, float(s.device_paced), s.force_bound,
            ]
        )  # fmt: skip
        self.state: Floats = np.zeros(at.HISTORY + s.delay_ticks + 3)
        self.state[at.MODE] = State.CONNECTED
        self.state[at.SHARE] = self.state[at.LAST_SHARE] = 1.0
        self.state[[at.MEASURED_AT, at.MEASURED_SPEED]] = math.nan
        self.row: Floats = np.zeros(len(COLUMNS) + n + 1 + (n if moving else 0))

    @property
    def row_width(self) -> int:
        """Numbers in a row of the ring: columns, weights, offset, and the widths where they change."""
        return int(self.row.size)

    @property
    def settled_basis(self) -> Basis:
        """The basis with its elements where they are now."""
        return self.basis.settled(self.identifier.bp)

    @property
    def moves(self) -> int | None:
        """How often an element of the basis moved; None where they stay."""
        return int(self.identifier.places[MOVES]) if self.identifier.placing else None

    @property
    def delay_ticks(self) -> int:
        """Ticks until a command takes effect, as the identifier assumes."""
        return int(self.settings[at.DELAY])

    @property
    def closed_loop(self) -> bool:
        """Whether feedback runs; otherwise the plan's voltages go out."""
        return bool(self.settings[at.CLOSED])

    @property
    def fault(self) -> int:
        """What the checks of the last tick found, as `layout` numbers it."""
        return int(self.state[at.FAULT])

    @property
    def updates(self) -> int:
        """How often the weights were changed."""
        return int(self.state[at.UPDATES])

    def remember(self, positions: Floats) -> None:
        """Take the memory of what is fed forward along `positions` (m), one a tick, of before the run."""
        regressors(self.basis, positions, self.compensator.bs, self.compensator.x[: self.basis.size])

    def adopt_weights(self, weights: Floats, memory: Floats | None = None) -> None:
        """Take weights (size of basis + 1) as the start, to which a diverged identifier goes back.

        `memory` is the state of a learner that holds them for known; as one that knows nothing if not given.
        """
        self.weights[:] = weights
        self.identifier.w_kept[:] = weights
        if memory is not None:
            self.identifier.ls[:] = memory
            self.identifier.ls_kept[:] = memory
