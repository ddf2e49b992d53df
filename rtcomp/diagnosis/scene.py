"""What a search for missing physics starts from: the recording's rows and scales, and what is tried on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.base import FIXED, Fitted
from rtcomp.diagnosis.motion import Motion
from rtcomp.kernels import Floats

Entry = dict[str, object]


@dataclass(frozen=True)
class Column:
    """A force tried as columns of free size; `compose` makes the entry from the sizes found."""

    name: str
    columns: Callable[[], list[Floats]]
    compose: Callable[[Floats], Entry]


@dataclass(frozen=True)
class Point:
    """An entry tried at work, as it stands."""

    entry: Entry

    @property
    def name(self) -> str:
        """The entry's name."""
        return str(self.entry["name"])


@dataclass(frozen=True)
class Scene:
    """What the recording offers: rows for columns, and the scales that searches start from."""

    motion: Motion
    fitted: Fitted
    x: Floats
    v: Floats
    time: Floats
    volts: Floats
    residual: Floats

    @classmethod
    def of(cls, motion: Motion, fitted: Fitted) -> Scene:
        """Gather the rows that were kept."""
        velocity = []
        for s in motion.strips:
            v = np.zeros_like(s.position)
            v[1:-1] = (s.position[2:] - s.position[:-2]) / (2 * motion.period)
            velocity.append(v)
        return cls(
            motion,
            fitted,
            motion.plain([s.position for s in motion.strips]),
            motion.smooth(velocity),
            motion.plain([s.time for s in motion.strips]),
            motion.smooth([s.voltage for s in motion.strips]),
            fitted.residual,
        )

    @property
    def span(self) -> float:
        """Length of the stroke (m)."""
        low, high = self.motion.stroke
        return high - low

    @property
    def level(self) -> float:
        """Friction with everything sliding (N)."""
        rows = slice(FIXED, FIXED + self.fitted.ledger.reaches.size)
        return float(np.sum(self.fitted.coefficients[rows] * self.fitted.ledger.reaches))

    @property
    def force_constant(self) -> float:
        """N/V."""
        return self.fitted.ledger.stage.force_constant

    def speeds(self, count: int) -> Floats:
        """Return speeds (m/s) spread over those of the motion."""
        moving = np.abs(self.v[np.abs(self.v) > 0])
        return np.asarray(np.quantile(moving, np.linspace(0.1, 0.85, count)))
