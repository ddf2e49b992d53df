"""The base of every explanation: the believed stage with its numbers refitted, within what is believable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp import physics
from rtcomp.diagnosis.blocks import Bounds
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.ledger import BIASES, MASS, MICRO, VISCOUS, WHOLE, Ledger, System, grid_of
from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.remembered import Memory
from rtcomp.kernels import Floats
from rtcomp.physics import Effect
from rtcomp.stage.stage import Stage

BELIEVED, FREED = 0.12, 0.6
"""How far off mass, viscous friction and micro-damping may be before that is a finding of its own; and how
far where a recording has shown that one of them is further off."""
SCALES = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.12, 1.25, 1.4, 1.6, 1.8)
"""Factors tried on the reaches of the friction grid."""
FINER = (0.94, 0.97, 1.03, 1.06)
"""Factors on the best of them that are tried next, where that is not the believed one."""
RELEASED = {"asymmetric-viscous-friction": VISCOUS}
"""Entries that say how a believed number differs by direction, so that it may not be what was believed."""
NUMBERS = (MASS, VISCOUS, MICRO)
"""Believed numbers whose columns come before those of friction."""
FIXED = len(NUMBERS)
ENTRY_OF = {MASS: "inertia", VISCOUS: "viscous-friction"}
"""Entries of the catalogue that are a change of one of them."""


def bounds_of(
    stage: Stage,
    size: int,
    slack: float = BELIEVED,
    names: Sequence[str] = (),
    freed: frozenset[str] = frozenset(),
) -> Bounds:
    """Return the bounds of the base's coefficients.

    Mass, viscous and micro-damping stay within `slack` of the belief, or FREED, unless one of the entries
    `names` releases them; friction elements are springs, not negative, so that the virgin curve rises ever
    less steeply.
    """
    m = stage.mechanics
    released = {RELEASED[n] for n in names if n in RELEASED}
    biased = any(e.get("name") in BIASES for e in m.effects)
    low, high = np.zeros(size), np.full(size, np.inf)
    for i, (name, value) in enumerate(zip(NUMBERS, (stage.mass, m.viscous, m.micro_damping), strict=True)):
        if name in released:
            low[i] = 0.0
        else:
            far = FREED if name in freed else slack
            low[i], high[i] = value * (1 - far), value * (1 + far)
    if biased:
        low[-1] = -np.inf
    return Bounds(low, high)


@dataclass(frozen=True)
class Fitted:
    """A ledger with the reaches that fit, its system, and the squared error of every block left out."""

    ledger: Ledger
    system: System
    bounds: Bounds
    errors: Floats
    scale: float
    freed: frozenset[str] = frozenset()
    """Believed numbers that may be further off than beliefs usually are: the recording has shown it."""

    @property
    def at_bounds(self) -> frozenset[str]:
        """Believed numbers that went as far as they may; what is believed to be nothing may go nowhere."""
        held = ~self.bounds.within(self.coefficients) & (self.bounds.high > self.bounds.low)
        return frozenset(name for name, at in zip(NUMBERS, held[:FIXED], strict=True) if at)

    @property
    def coefficients(self) -> Floats:
        """Coefficients of all columns, fitted on all that may be seen."""
        return self.system.blocks.coefficients(self.ledger.seen, self.bounds)

    @property
    def residual(self) -> Floats:
        """Force (N) on every kept row that the fit leaves: drive side less motion side."""
        return np.asarray(self.system.y - self.system.columns @ self.coefficients)

    @property
    def hysteresis(self) -> Floats:
        """Force (N) of the friction elements on every kept row."""
        rows = slice(FIXED, FIXED + self.ledger.reaches.size)
        return np.asarray(self.system.columns[:, rows] @ self.coefficients[rows])


def fit_base(
    stage: Stage,
    motion: Motion,
    effects: list[Effect] | None = None,
    scales: tuple[float, ...] = SCALES,
    memory: Memory | None = None,
    freed: frozenset[str] = frozenset(),
) -> Fitted:
    """Refit the believed stage, with `effects` at work, on the grid of reaches that predicts best.

    `memory` is that of another ledger of this stage and motion; `freed` numbers may be further off.
    """
    memory = memory or Memory()
    given = list(effects or [])
    names = [e.name for e in given]
    at_work_too = [companion.name for e in given for companion in e.companions()]
    whole, play = any(name in WHOLE for name in (*names, *at_work_too)), "backlash" in names
    known = [e for e in map(physics.build, stage.mechanics.effects) if e.place is not physics.Place.DRIVE]

    def at_scale(scale: float) -> Fitted:
        ledger = Ledger(stage, motion, grid_of(stage, scale), known, memory)
        # What asks for the whole of friction is given first the fit without it, then the one with it; what
        # hangs behind a play first the believed friction, then the one found with it.
        for at_work in [[], given, given] if whole else [given, given] if play else [given]:
            system = ledger.system(at_work)
            bounds = bounds_of(stage, system.columns.shape[1], names=names, freed=freed)
            found = system.blocks.coefficients(ledger.seen, bounds)
            ledger.weigh(found[FIXED : FIXED + ledger.reaches.size])
            ledger.carried = found[:FIXED] if play and at_work else None
        return Fitted(ledger, system, bounds, system.blocks.left_out(ledger.seen, bounds), scale, freed)

    return min(shared(at_scale, scales), key=lambda fitted: float(fitted.errors.sum()))


def finer(stage: Stage, motion: Motion, base: Fitted) -> Fitted:
    """Return `base` between the reaches that were tried, where other than the believed ones fit better.

    What a coarse choice of them leaves looks like an effect.
    """
    if base.scale == 1.0:
        return base
    scales = tuple(base.scale * factor for factor in FINER)
    between = fit_base(stage, motion, scales=scales, memory=base.ledger.memory)
    return min(base, between, key=lambda fitted: float(fitted.errors.sum()))
