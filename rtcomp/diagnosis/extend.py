"""From a fit to a stage: the refitted numbers and the named entries, in the believed stage's own format."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rtcomp.diagnosis.base import FIXED, Fitted
from rtcomp.diagnosis.scene import Entry
from rtcomp.stage.stage import Stage

REPLACED = {"inertia": "mass"}
"""Entries that are a believed number with another value, and the stage's key of it."""


def extended_stage(believed: Stage, fitted: Fitted, entries: Sequence[Entry]) -> Stage:
    """Return the stage with the fit's mass, damping and friction, and with `entries` among its effects."""
    c = fitted.coefficients
    reaches = fitted.ledger.reaches
    data = believed.to_dict()
    mechanics: dict[str, Any] = data["stage"]
    mechanics["mass"] = float(max(c[0], 1e-3 * believed.mass))
    mechanics["viscous"] = float(max(c[1], 0.0))
    mechanics["micro_damping"] = float(max(c[2], 0.0))
    stiffness = c[FIXED : FIXED + reaches.size]
    most = float(np.max(stiffness * reaches)) if stiffness.size else 0.0
    elements = [
        {"stiffness": float(k), "reach": float(r)}
        for k, r in zip(stiffness, reaches, strict=True)
        if k * r > 1e-6 * most
    ]
    if elements:
        mechanics["friction"] = elements
    else:
        mechanics.pop("friction", None)
    if fitted.ledger.biased:
        _shift_bias(mechanics["effects"], float(c[FIXED + reaches.size]), believed.force_constant)
    mechanics["effects"] = [*mechanics.get("effects", []), *[dict(e) for e in entries]]
    if not mechanics["effects"]:
        del mechanics["effects"]
    return Stage.from_dict(data)


def with_forces(stage: Stage, factor: float) -> Stage:
    """Return a stage that moves as `stage` does, with all its forces and the drive's times `factor`."""
    m = stage.mechanics
    changes: dict[str, Any] = {
        key: factor * getattr(m, key) for key in ("mass", "force_constant", "viscous", "micro_damping")
    }
    if isinstance(m.friction, list):
        changes["friction"] = [{"stiffness": factor * e.stiffness, "reach": e.reach} for e in m.friction]
    return stage.with_changes(stage=changes)


def _shift_bias(effects: list[dict[str, Any]], force: float, force_constant: float) -> None:
    """Add `force` (N) to the first constant force or offset among `effects`."""
    for effect in effects:
        if effect["name"] in ("constant-force", "gravity"):
            effect["force"] = float(effect.get("force", 0.0)) + force
            return
        if effect["name"] == "drive-offset":
            effect["offset"] = float(effect["offset"]) + force / force_constant
            return


def level_and_reach(elements: Sequence[Sequence[float]]) -> tuple[float, float]:
    """Return friction.level (N, sum of yield forces) and friction.reach (m, travel to half of it).

    An element is its stiffness (N/m) and its reach (m).
    """
    k, r = np.array([e[0] for e in elements]), np.array([e[1] for e in elements])
    level = float(np.sum(k * r))
    travel = np.concatenate([[0.0], np.sort(r)])
    force = np.array([float(np.sum(k * np.minimum(x, r))) for x in travel])
    return level, float(np.interp(0.5 * level, force, travel))
