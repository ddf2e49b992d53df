"""What a hidden effect is to the trial: how it is drawn, and how it grows with its strength."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtcomp.trial.axis import Loop, Physics

Size = tuple[dict[str, float], dict[str, float]]
"""Changes of the plant's parameters, and the true values in the stage file's words (SI units)."""


@dataclass(frozen=True)
class Rig:
    """The stage that an effect is hidden in, and how it moves."""

    physics: Physics
    loop: Loop
    stroke: float
    """m, largest distance from the middle."""
    speed: float
    """m/s, rms of the speed."""
    effort: float
    """N, rms force of the motion."""
    volts: float
    """V, 99th percentile of the command's size."""
    seconds: float
    rotary: bool = False


@dataclass(frozen=True)
class Sized:
    """An effect whose shape is drawn and whose strength is still open."""

    at: Callable[[float], Size]
    """The effect at a strength; 1 is a typical one."""
    least: float = 1e-6
    most: float = 1e6
    """Between these strengths it is what its name says."""


@dataclass(frozen=True)
class Secret:
    """One thing that can be hidden."""

    name: str
    draw: Callable[[np.random.Generator, Rig], Sized]
    scored: tuple[str, ...] = ()
    """Parameters whose meaning leaves no choice, so that estimates can be held against the truth."""
    period: str = ""
    """The one of them that is a period or a frequency."""
    known: Callable[[np.random.Generator, Rig], tuple[dict[str, float], dict[str, Any]]] | None = None
    """What the stage must have, known to everybody, for the effect to exist: plant, entry of `effects`."""
    outside: bool = False
    retuning: bool = False
    """Nothing but another value of what the stage file holds anyway."""


def linear(slot: str, typical: float, parameter: str | None = None) -> Sized:
    """Return an effect of one parameter, the same number in the plant and in the stage file."""

    def at(strength: float) -> Size:
        value = typical * strength
        return {slot: value}, {parameter: value} if parameter else {}

    return Sized(at)


def either(chance: np.random.Generator) -> float:
    """Return +1 or -1."""
    return 1.0 if chance.random() < 0.5 else -1.0


def log_between(chance: np.random.Generator, low: float, high: float) -> float:
    """Return a number whose logarithm is evenly distributed."""
    return float(np.exp(chance.uniform(np.log(low), np.log(high))))
