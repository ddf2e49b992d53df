"""Linear stop operators: a bank of elastic, perfectly plastic elements (Kuhnen's and Maxwell's).

    E_r[u] = u - y,    y <- max(u - r, min(u + r, y))    (y is the play operator of the same reach)

With weights k_r it is the Prandtl-Ishlinskii model in its stop form. The dead zones that Kuhnen's modified
model puts behind the bank, for asymmetric loops, are no part of it: they do not enter linearly beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import Basis, checked_keys, register_basis
from rtcomp.kernels import Floats, basis_kernel

STARTED, PLAY = 0, 1
"""Places in the state: has seen an input; from here on the play operators' positions y_i (m)."""


@basis_kernel
def stop_operators(p: Floats, s: Floats, x: Floats, u: float) -> None:
    """p: N, reaches r_1 .. r_N (m). s: see the places above. x: stop outputs u - y_i in [-r_i, r_i] (m).

    Keeping y instead of u - y makes the memory exact: an element that sticks does not change at all.
    Every sticking element's output moves with the input, so a step costs all N.
    """
    count = int(p[0])
    if s[0] == 0.0:
        s[0] = 1.0
        for i in range(count):
            s[1 + i] = u
        return
    for i in range(count):
        reach = p[1 + i]
        play = min(max(s[1 + i], u - reach), u + reach)
        s[1 + i] = play
        x[i] = min(max(u - play, -reach), reach)


def checked_reaches(reaches: Sequence[float] | Floats, owner: str) -> Floats:
    """Return the reaches (m) as an array, or raise ConfigError for none or one that is not above 0."""
    values = np.array(reaches, dtype=np.float64).reshape(-1)
    if values.size == 0:
        raise ConfigError(f"{owner} model: reaches are empty; give at least one (m)", key=("reaches",))
    for i, reach in enumerate(values):
        if not (np.isfinite(reach) and reach > 0):
            raise ConfigError(
                f"{owner} model: reaches[{i}] is {reach:g} m; a reach must be above 0", key=("reaches", i)
            )
    return values


@register_basis
class StopBasis(Basis):
    """Stop operators of the given reaches (m); weights are stiffnesses (N/m).

    Raises ConfigError for no, negative, zero or non-finite reaches.
    """

    name = "stop"
    kernel = stop_operators
    source = "Krasnosel'skii and Pokrovskii (1989); Kuhnen (2003), European J. Control 9(4)"

    def __init__(self, reaches: Sequence[float] | Floats) -> None:
        self.reaches = checked_reaches(reaches, self.name)

    @classmethod
    def over(cls, count: int, total: float, spacing: float = 1.0) -> StopBasis:
        """Put the reaches where the interval operator of the same arguments has its corners.

        `count` reaches up to total / 2 (m), the last gap `spacing` times as wide as the first.
        """
        gaps = np.geomspace(1.0, spacing, count)
        return cls(np.cumsum(gaps) * (0.5 * total / gaps.sum()))

    @property
    def size(self) -> int:
        """Number of elements."""
        return int(self.reaches.size)

    def vector(self) -> Floats:
        """Return N and the reaches."""
        return np.concatenate([[float(self.size)], self.reaches])

    def initial_state(self) -> Floats:
        """Return the state with every element relaxed, before any input."""
        return np.zeros(PLAY + self.size)

    def scales(self) -> Floats:
        """Return the reaches."""
        return self.reaches.copy()

    def to_dict(self) -> dict[str, Any]:
        """Return name and reaches."""
        return {"model": self.name, "reaches": [float(r) for r in self.reaches]}

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> StopBasis:
        """Build from ``{reaches: [...]}``."""
        checked_keys(entry, cls.name, ["reaches"])
        return cls(entry["reaches"])
