"""Numbers of a belief that a trajectory's fit moves, and the stage that they make."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting.retuned import believed_friction
from rtcomp.diagnosis.fitting.stage_of import bank, merged
from rtcomp.diagnosis.forces.signals import BASE
from rtcomp.diagnosis.numerics.regression import Prior
from rtcomp.diagnosis.settings import BELIEF_SD
from rtcomp.kernels import Floats
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.stage.stage import Stage

LEVEL, REACH = "level", "reach"
FAR = 4.0
"""Logarithm of the largest factor that friction is moved by, and sizes in those of the believed ones."""


@dataclass(frozen=True)
class Number:
    """A number of the belief: its name, or the place of a believed entry's size; what it is moved by."""

    name: str
    scale: float
    """What 1 stands for: a factor of e where it is positive (0), else so much more."""
    near: bool
    """Whether the belief holds it near its value."""
    at: int = 0


class Belief:
    """A stage whose numbers move: those that it states, friction's level and reach, sizes of its forces."""

    def __init__(self, stage: Stage, force: float) -> None:
        """Take `stage`; `force` (N) is the scale of a size that it states to be 0."""
        self.stage = stage
        self.own = [dict(e) for e in stage.mechanics.effects if is_sized(dict(e))]
        """Entries of forces of free size."""
        self.sizes: Floats = np.concatenate([np.zeros(0), *(ent.sizes_of(e) for e in self.own)])
        m = stage.mechanics
        found = [Number(n, 0.0, near=True) for n in BASE if float(getattr(m, n)) > 0.0]
        if m.micro_damping > 0.0:
            found.append(Number("micro_damping_speed", 0.0, near=True))
        self.friction = stage.friction if isinstance(stage.friction, MaxwellSlip) else None
        if self.friction is not None:
            found += [Number(LEVEL, 0.0, near=False), Number(REACH, 0.0, near=False)]
        for i, size in enumerate(self.sizes.tolist()):
            found.append(Number("size", abs(size) or 0.1 * force, near=size != 0.0, at=i))
        self.numbers = found

    @property
    def prior(self) -> Prior:
        """What is believed of the numbers' moves."""
        size = len(self.numbers)
        near = np.array([n.near for n in self.numbers], dtype=np.float64)
        return Prior(np.zeros(size), near / BELIEF_SD**2, np.full(size, -FAR), np.full(size, FAR))

    def moved(self, c: Floats, entries: Sequence[Entry]) -> Stage:
        """Return the stage of numbers moved by `c` (p,), with `entries`; raise ConfigError out of range."""
        data = self.stage.to_dict()
        m: dict[str, Any] = data["stage"]
        sizes, level, reach = self.sizes.copy(), 1.0, 1.0
        for number, value in zip(self.numbers, c.tolist(), strict=True):
            if number.name == LEVEL:
                level = math.exp(value)
            elif number.name == REACH:
                reach = math.exp(value)
            elif number.scale == 0.0:
                m[number.name] *= math.exp(value)
            else:
                sizes[number.at] += value * number.scale
        if self.friction is not None:
            moved = [(k * level / reach, r * reach) for k, r in self.friction.elements]
            m["friction"] = bank(moved, self.friction.exponent)
        at, effects = 0, []
        for entry in m.get("effects", []):
            mine = dict(entry)
            if is_sized(mine):
                count = ent.sizes_of(entry).size
                mine, at = ent.composed(mine, sizes[at : at + count]), at + count
            effects.append(mine)
        effects = merged([*effects, *entries])
        for entry in effects:
            ent.build(entry)  # out of range, it says so as all others do
        m["effects"] = effects
        if not effects:
            del m["effects"]
        return Stage.from_dict(data)

    def values(self, c: Floats, amounts: Floats) -> Floats:
        """Return mass, damping, level and reach of friction, and believed `amounts` (q,), as moved by `c`.

        Those with the sign that is believed.
        """
        stage = self.moved(c, [])
        m, held = stage.mechanics, believed_friction(stage)
        own = ent.all_amounts([dict(e) for e in m.effects if is_sized(dict(e))])[: amounts.size]
        sign = np.where(amounts < 0.0, -1.0, 1.0)
        return np.array([*(float(getattr(m, n)) for n in BASE), *held, *(sign * own)])


def is_sized(entry: Entry) -> bool:
    """Tell whether an entry adds a force whose size is a number."""
    kind = ent.kind_of(entry)
    return ent.adds_force(kind) and bool(kind.linear)
