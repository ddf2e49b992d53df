"""What a family of axes is to the trial: how a stage is drawn, what is believed of it, how it moves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.trial.axis import Loop, Physics
from rtcomp.trial.hidden import EFFECTS, OUTSIDE, RETUNED, Secret
from rtcomp.trial.hidden.forms import FORMS
from rtcomp.trial.motion import draw_reference
from rtcomp.trial.stagefile import Believed

Motion = dict[str, float]
"""Numbers from which a family makes references; `seconds` is always among them."""
Stage = tuple[Loop, Physics, Motion]

FRICTIONLESS = frozenset({
    "asymmetric-friction", "stribeck", "position-dependent-friction", "load-dependent-friction",
    "non-congruent-friction", "frictional-lag", "stiction-ageing", "friction-drift", "creep", "backlash",
})  # fmt: skip
"""Effects that an axis without friction cannot hide; a flexure has no play either."""
NO_FRICTION_VALUES = frozenset({"retuned-friction-level", "retuned-friction-reach"})


def manoeuvres(chance: np.random.Generator, loop: Loop, motion: Motion) -> Floats:
    """Return multisines, strokes, nested reversals and rests, (K,)."""
    return draw_reference(chance, loop.rate, **motion)


@dataclass(frozen=True)
class Family:
    """A family of axes. A new one is a module in this folder that sets `FAMILY`."""

    name: str
    says: str
    """One line for a person."""
    stage: Callable[[np.random.Generator], Stage]
    """Draws a stage, its loop and the numbers of its motion."""
    reference: Callable[[np.random.Generator, Loop, Motion], Floats] = manoeuvres
    """Draws a reference (m, (K,)); in open loop a command (V, (K,))."""
    belief: Callable[[Physics, np.random.Generator], Believed] = Believed.of
    lacks: frozenset[str] = frozenset()
    """Names of what it cannot hide."""
    forms: float = 0.3
    """Share of hidden effects drawn in another form, of those that have one."""
    rotary: bool = False

    @property
    def effects(self) -> tuple[Secret, ...]:
        """Effects that it can hide; where all have other forms, those that have one."""
        return tuple(s for s in self._of(EFFECTS) if self.forms < 1.0 or s.name in FORMS)

    @property
    def outside(self) -> tuple[Secret, ...]:
        """Shapes outside the catalogue that it can hide."""
        return self._of(OUTSIDE)

    @property
    def retuned(self) -> tuple[Secret, ...]:
        """Other values that it can hide."""
        return self._of(RETUNED)

    def _of(self, secrets: tuple[Secret, ...]) -> tuple[Secret, ...]:
        return tuple(s for s in secrets if s.name not in self.lacks)


def log_uniform(chance: np.random.Generator, low: float, high: float) -> float:
    """Return a number whose logarithm is evenly distributed."""
    return math.exp(chance.uniform(math.log(low), math.log(high)))


def pid(
    chance: np.random.Generator, physics: Physics, omega: float, integral: tuple[float, float]
) -> tuple[float, float, float]:
    """Return kp, ki, kd: a free mass has its poles at `omega` (rad/s), ki is kp times `integral` (1/s)."""
    kp = physics.mass * omega**2 / physics.force_constant
    kd = 2.0 * chance.uniform(0.4, 0.7) * physics.mass * omega / physics.force_constant
    return kp, kp * chance.uniform(*integral), kd


def believed_springs(physics: Physics, chance: np.random.Generator) -> Believed:
    """Draw a belief whose spring and pendulum, too, are off by up to a tenth."""
    believed = Believed.of(physics, chance)
    factors = 1.0 + 0.1 * chance.uniform(-1.0, 1.0, 2)
    if believed.physics is physics:
        return believed
    wrong = believed.physics._replace(
        spring=physics.spring * factors[0], pendulum=physics.pendulum * factors[1]
    )
    return Believed(wrong, believed.stiffness)
