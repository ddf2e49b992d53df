"""One motion after another: friction remembers what was followed before what is followed now."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.control.references import Reference
from rtcomp.control.strokes import smooth_step
from rtcomp.kernels import Floats


@dataclass(frozen=True)
class FollowingOn:
    """The motion `now` from time zero on, and the one `before`, which ended `between` (s) before that.

    In between the axis came to rest where `now` starts: let go of, it may have sprung back.
    """

    before: Reference
    now: Reference
    between: float

    @property
    def earlier(self) -> float:
        """Return how long before time zero the motion begins (s)."""
        return self.before.duration + self.between

    def evaluate(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Return position (m), velocity (m/s) and acceleration (m/s^2) at the times `t` (s), (K,)."""
        x, v, a = self.before.evaluate(np.minimum(t, -self.between) + self.earlier)
        b, db, ddb = smooth_step(t / self.between + 1.0)
        way = self.now.start - x
        springing = (x + b * way, db / self.between * way, ddb / self.between**2 * way)
        parts = zip((x, v, a), springing, self.now.evaluate(t), strict=True)
        x, v, a = (np.where(t < -self.between, p, np.where(t < 0.0, q, r)) for p, q, r in parts)
        return x, v, a
