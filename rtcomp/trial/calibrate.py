"""Give a hidden effect the strength that was drawn for it, measured on the force balance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.trial.hidden import SECRETS, Rig, Secret, Sized
from rtcomp.trial.oracle import Bare, Strength
from rtcomp.trial.plant import Run, simulate

NEEDED = 1.0
"""Rms of an effect over that of the floor from which it counts as detectable."""
ROUNDS = 6
"""Runs at most until the strength is near the target."""
NEAR = 1.25
"""Factor from the target that is near enough: what is scored is the strength measured."""


@dataclass(frozen=True)
class Grown:
    """A hidden effect of a size: changes of the plant, true parameters, how strongly it shows."""

    name: str
    changes: dict[str, float]
    parameters: dict[str, float]
    shows: Strength
    beyond_belief: bool = True
    """Whether the stage with it is further from the believed one than beliefs are wrong anyway."""
    form: str = ""
    """Which of its other forms it has; "" for the one that every trial drew before there were others."""

    @property
    def detectable(self) -> bool:
        """Whether it stands out of what noise and sampling leave, and of what beliefs are wrong by."""
        return self.beyond_belief and self.shows.detectability(SECRETS[self.name].retuning) >= NEEDED

    def to_json(self) -> dict[str, Any]:
        """Return it as it is sealed."""
        return {
            "name": self.name,
            "form": self.form,
            "changes": self.changes,
            "parameters": self.parameters,
            "share": self.shows.share,
            "beyond": self.shows.beyond,
            "floor": self.shows.floor,
            "beyond_belief": self.beyond_belief,
            "detectable": self.detectable,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Grown:
        """Read what `to_json` wrote."""
        shows = Strength(data["share"], data["beyond"], data["floor"])
        return cls(
            data["name"], data["changes"], data["parameters"], shows, data["beyond_belief"], data["form"]
        )


def grow(secret: Secret, sized: Sized, rig: Rig, reference: Floats, clean: Run, target: float) -> Grown:
    """Return the effect at about `target` (rms force over that of the motion), alone in the plant.

    What counts of it is what no retuning of the believed parameters takes up, or half of all where that is
    more; of a retuning, all. Where the
    effect cannot be as strong, it stays at the most that leaves the axis controlled.
    """
    best: tuple[float, float, Grown] | None = None
    bare = Bare.of(rig.physics, rig.loop, clean)
    at, most = min(max(1.0, sized.least), sized.most), sized.most
    for _ in range(ROUNDS):
        changes, parameters = sized.at(at)
        changes = {k: float(v) for k, v in changes.items()}
        shows = _measure(rig, changes, reference, bare)
        if shows is None:
            most = at
            at = max(0.3 * at, sized.least)
            continue
        grown = Grown(secret.name, changes, {k: float(v) for k, v in parameters.items()}, shows)
        got = max(shows.share if secret.retuning else max(shows.beyond, 0.5 * shows.share), 1e-9)
        off = abs(np.log(got / target))
        if best is None or off < best[0]:
            best = (float(off), at, grown)
        if off < np.log(NEAR):
            break
        following = min(max(at * min(max(target / got, 0.05), 20.0), sized.least), 0.9 * most)
        if abs(np.log(following / at)) < 0.02:
            break
        at = following
    if best is None:
        raise RuntimeError(f"{secret.name} leaves no axis to control at any strength from {sized.least:g}")
    return best[2]


def _measure(rig: Rig, changes: dict[str, float], reference: Floats, bare: Bare) -> Strength | None:
    """Return the strength, or None where the controller loses the axis."""
    try:
        run = simulate(rig.physics._replace(**changes), rig.loop, reference, 1)
    except FloatingPointError:
        return None
    lost = np.mean(np.abs(run.voltage) >= 0.999 * rig.physics.voltage_limit) > 0.02
    if lost or np.max(np.abs(run.truth)) > 2.0 * rig.stroke:
        return None
    return bare.strength(run)
