"""Plans: the table of what the loop shall do at each tick, from a reference or from a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.control.references import Reference
from rtcomp.control.strokes import smooth_step
from rtcomp.kernels import Floats
from rtcomp.loop.tick import (
    FEEDFORWARD,
    KNOWN,
    LEAD_FORCE,
    LEAD_POSITION,
    LEARN,
    LET_GO,
    PLAN_WIDTH,
    REFERENCE,
    VOLTS,
)  # fmt: skip
from rtcomp.stage.balance import known_force
from rtcomp.stage.stage import Stage

HOLD = 0.5
"""Ticks: a command held over a tick acts, on average, half a tick after it takes effect."""


@dataclass(frozen=True)
class ReferencePlan:
    """Follow a reference. `learn` is the window (s) in which weights may change.

    Feedforward begins at `feedforward_from` (s; None for never) and grows to its full share over
    `feedforward_fade` (s), so that the feedback, which carried the friction until then, can let go.
    """

    reference: Reference
    stage: Stage
    period: float
    ticks: int
    delay_ticks: int = 0
    learn: tuple[float, float] | None = None
    feedforward_from: float | None = None
    feedforward_fade: float = 0.0
    lead: Floats | None = None
    """V, (ticks,): the whole feedforward of each tick (`lead.lead_volts`), in place of the stage's inertia
    and known forces. Made beforehand as one piece, since friction remembers."""
    let_go: float = 0.0
    """s at the end, over which the whole command dies out: an axis let go at once swings."""

    def rows(self, first: int, count: int) -> Floats:
        """Return rows `first` to `first + count`, shape (count, PLAN_WIDTH)."""
        t = np.arange(first, first + count, dtype=np.float64) * self.period
        out = np.zeros((count, PLAN_WIDTH))
        out[:, REFERENCE] = self.reference.evaluate(t)[0]
        acts = t + (self.delay_ticks + HOLD) * self.period
        x, v, a = self.reference.evaluate(acts)
        out[:, LEAD_POSITION] = x
        if self.lead is not None:
            out[:, LEAD_FORCE] = self.stage.force_constant * self.lead[first : first + count]
        else:
            out[:, LEAD_FORCE] = self.stage.mass * a + known_force(self.stage, acts, x, v)
        before = t - self.period
        x, v, _ = self.reference.evaluate(before)
        out[:, KNOWN] = known_force(self.stage, before, x, v, viscous=False)
        if self.learn is not None:
            out[:, LEARN] = (t >= self.learn[0]) & (t <= self.learn[1])
        if self.feedforward_from is not None:
            since = t - self.feedforward_from
            fade = self.feedforward_fade
            share = smooth_step(since / fade)[0] if fade > 0 else np.ones(count)
            out[:, FEEDFORWARD] = np.where(since >= 0, share, 0.0)
        if self.let_go > 0.0:
            out[:, LET_GO] = smooth_step(1.0 - (self.ticks * self.period - t) / self.let_go)[0]
        return out


@dataclass(frozen=True)
class VoltagePlan:
    """Open loop: a voltage (V) for each tick; learn from it in the window `learn` (s)."""

    volts: Floats
    period: float
    known: Floats | None = None
    reference: Floats | None = None
    learn: tuple[float, float] | None = None

    @property
    def ticks(self) -> int:
        """Length of the run."""
        return int(self.volts.size)

    def rows(self, first: int, count: int) -> Floats:
        """Return rows `first` to `first + count`, shape (count, PLAN_WIDTH)."""
        part = slice(first, first + count)
        t = np.arange(first, first + count, dtype=np.float64) * self.period
        out = np.zeros((count, PLAN_WIDTH))
        out[:, VOLTS] = self.volts[part]
        if self.reference is not None:
            out[:, REFERENCE] = out[:, LEAD_POSITION] = self.reference[part]
        if self.known is not None:
            out[:, KNOWN] = self.known[part]
        if self.learn is not None:
            out[:, LEARN] = (t >= self.learn[0]) & (t <= self.learn[1])
        return out
