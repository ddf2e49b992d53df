"""How the level of friction grows: at equal stiffness, or with the whole force."""

from __future__ import annotations

from rtcomp.kernels import Floats, compiled
from rtcomp.physics.effect import Parameter
from rtcomp.physics.wires import REACH, SCALE

STIFFENING = Parameter(
    "stiffening", "1", 0.0, 1.0, "1: contacts that hold more are stiffer, 0: they only hold more", 0.0
)


@compiled
def grow(w: Floats, factor: float, stiffening: float) -> None:
    """Multiply the level of friction by `factor`, its stiffness by factor^stiffening."""
    if stiffening > 0.0:
        shared = factor**stiffening
        w[SCALE] *= shared
        factor /= shared
    w[REACH] *= factor
