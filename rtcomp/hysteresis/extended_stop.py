"""Extended stop operators: stops that go on with a slope of their own after yielding.

The paper cites them from Lampaert and Swevers (AIM 2001), who identify them with recursive least squares;
that text was not at hand, so this is a reading of the name, not a transcription. A stop that keeps the
share h of its stiffness after it has yielded is

    X_{r,h}[u] = (1 - h) E_r[u] + h (u - u_0)

and a bank of them, each with its own unknown h, is linear in one more number only: the sum of the slopes
that remain. So the regressors are the stops' outputs and, last, the travel u - u_0 from the start. It can
model what the plain bank cannot, loops whose branches do not level off in the range of the motion, and stays
inside what the Preisach plane can model, as the paper says of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import Basis, checked_keys, register_basis
from rtcomp.hysteresis.stop import StopBasis, checked_reaches
from rtcomp.kernels import Floats, basis_kernel

STARTED, ORIGIN, PLAY = 0, 1, 2
"""Places in the state: has seen an input; that input u_0 (m); then the play operators' positions (m)."""


@basis_kernel
def extended_stop_operators(p: Floats, s: Floats, x: Floats, u: float) -> None:
    """p: N, reaches r_1 .. r_N (m). x: N stop outputs, then the travel u - u_0 (m); costs all N a step."""
    count = int(p[0])
    if s[0] == 0.0:
        s[0] = 1.0
        s[1] = u
        for i in range(count):
            s[2 + i] = u
        return
    for i in range(count):
        reach = p[1 + i]
        play = min(max(s[2 + i], u - reach), u + reach)
        s[2 + i] = play
        x[i] = min(max(u - play, -reach), reach)
    x[count] = u - s[1]


@register_basis
class ExtendedStopBasis(Basis):
    """Extended stop operators of the given reaches (m); `travel` (m) is the expected motion to either side.

    `travel` scales the last regressor for the learner and is, unless given, the largest reach. Raises
    ConfigError for no, negative, zero or non-finite reaches or travel.
    """

    name = "extended-stop"
    kernel = extended_stop_operators
    source = "after Lampaert and Swevers (2001), IEEE/ASME AIM, Como; see the module's text"

    def __init__(self, reaches: Sequence[float] | Floats, travel: float | None = None) -> None:
        self.reaches = checked_reaches(reaches, self.name)
        self.travel = float(self.reaches.max()) if travel is None else float(travel)
        if not (np.isfinite(self.travel) and self.travel > 0):
            raise ConfigError(
                f"extended-stop model: travel is {self.travel:g} m; it must be above 0", key=("travel",)
            )

    @classmethod
    def over(cls, count: int, total: float, spacing: float = 1.0) -> ExtendedStopBasis:
        """Give `count` regressors: one for the travel, the others stops up to total / 2 (m).

        The last gap between reaches is `spacing` times as wide as the first.
        """
        return cls(StopBasis.over(max(count - 1, 1), total, spacing).reaches)

    @property
    def size(self) -> int:
        """Number of elements, and one."""
        return int(self.reaches.size) + 1

    def vector(self) -> Floats:
        """Return N and the reaches."""
        return np.concatenate([[float(self.reaches.size)], self.reaches])

    def initial_state(self) -> Floats:
        """Return the state with every element relaxed, before any input."""
        return np.zeros(PLAY + self.reaches.size)

    def scales(self) -> Floats:
        """Return the reaches and the travel."""
        return np.append(self.reaches, self.travel)

    def to_dict(self) -> dict[str, Any]:
        """Return name, reaches and travel."""
        return {"model": self.name, "reaches": [float(r) for r in self.reaches], "travel": self.travel}

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> ExtendedStopBasis:
        """Build from ``{reaches: [...], travel: ...}``; `travel` may be left out."""
        checked_keys(entry, cls.name, ["reaches"], ["travel"])
        return cls(**entry)
