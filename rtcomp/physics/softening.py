"""Contacts that are softer the more they carry."""

from __future__ import annotations

from rtcomp.kernels import compiled


@compiled
def softened(held: float, limit: float, softening: float) -> float:
    """Return a force or deflection bent by `softening`: unchanged at 0 and at the limit, steepest at 0."""
    if softening == 0.0:
        return held
    return held * (1.0 + softening * (1.0 - min(abs(held) / limit, 1.0)))
