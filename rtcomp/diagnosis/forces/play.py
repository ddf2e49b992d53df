"""What a play leaves behind: the path of the load."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.cache import key_of
from rtcomp.kernels import Floats, compiled
from rtcomp.physics import Effect, Place, wires
from rtcomp.physics.coupled import contact
from rtcomp.physics.program import COUNT, Program, run_chain
from rtcomp.physics.yielding import yielded

FINE = 0.3
"""Longest sub-step (rad) of the load's oscillation behind a play."""


@dataclass(frozen=True)
class Load:
    """What is behind a play: its friction and inertia, and how it meets the ends."""

    mass: float
    viscous: float
    micro_damping: float
    micro_speed: float
    stiffness: Floats
    """(n,) N/m of elements, with `reaches` (n,) m."""
    reaches: Floats
    exponent: float = 0.0
    """Of the law by which they yield."""


@dataclass(frozen=True)
class Carried:
    """What is behind a play: friction as stiffnesses (N/m) of the units, and the other forces on the load."""

    play: Effect
    weights: Floats
    pushes: tuple[Effect, ...]

    @property
    def key(self) -> Hashable:
        """What tells it from others."""
        return key_of([self.play]), self.weights.tobytes(), key_of(self.pushes)


def carried_by(bodies: Sequence[Effect], adding: Sequence[Effect], held: Floats) -> Carried | None:
    """Return what is behind a play of `bodies`, friction of stiffnesses `held` (N/m); None without a play.

    `adding` are effects that add a force.
    """
    play = next((e for e in bodies if e.behind and _active(e)), None)
    pushes = [e for e in adding if e.place in (Place.MECHANICS, Place.DISTURBANCE)]
    pushes += [e for e in bodies if not e.behind and not e.moving_mass]
    return Carried(play, held, tuple(pushes)) if play is not None else None


def _active(effect: Effect) -> bool:
    """Tell whether an effect is away from the values at which it changes nothing."""
    neutral = effect.neutral or {}
    return not neutral or any(effect.values[name] != value for name, value in neutral.items())


def behind_play(
    x: Floats,
    period: float,
    gap: float,
    contact_hz: float,
    load: Load,
    pushes: Sequence[Effect] = (),
    start: float = 0.0,
) -> Floats:
    """Return the position (m) of a load that `x` (m, rows of `period` s) drives through a play of +-`gap`.

    The load's equation of motion, in sub-steps of its fastest oscillation: friction and the forces `pushes`,
    from the time `start` (s) on, against the contact of either end, which gives way and does not pull. Where
    neither end holds it, it stays, or flies on.
    """
    omega = 2.0 * math.pi * contact_hz
    stroke = float(np.abs(x).max(initial=0.0)) + gap
    stiffness = float(np.sum(load.stiffness)) + sum(e.stiffness_within(stroke) for e in pushes)
    held = math.sqrt(omega**2 + stiffness / load.mass)
    parts = max(1, math.ceil(period * held / FINE))
    program = Program(sorted(pushes, key=lambda e: (e.place, e.order)))
    w = np.zeros(wires.COUNT)
    w[wires.TIME] = start
    w[wires.STEP] = period / parts
    return _drawn(
        x, period / parts, parts, gap, omega, load.mass, load.viscous, load.micro_damping, load.micro_speed,
        load.stiffness, load.reaches, load.exponent, program.steps, program.p, program.s, w,
    )  # fmt: skip


@compiled
def _drawn(
    x: Floats, h: float, parts: int, gap: float, omega: float, mass: float, viscous: float, micro: float,
    micro_speed: float, stiffness: Floats, reaches: Floats, exponent: float, steps: np.ndarray, p: Floats,
    s: Floats, w: Floats,
) -> Floats:  # fmt: skip
    out = np.empty_like(x)
    z = np.zeros_like(reaches)
    y, u = x[0], 0.0
    out[0] = y
    for k in range(1, x.size):
        base = (x[k] - x[k - 1]) / (h * parts)
        for j in range(parts):
            at = x[k - 1] + base * j * h  # where the load is, too: speeds are half a step on
            force = 0.0
            for i in range(z.size):
                force -= stiffness[i] * z[i]
            if steps[COUNT] > 0:
                w[wires.POSITION], w[wires.VELOCITY], w[wires.MOVED] = y, u, h * u
                w[wires.PUSH] = 0.0
                run_chain(steps, p, s, w, 0, steps[COUNT])
                force += w[wires.PUSH]
                w[wires.TIME] += h
            ratio = u / micro_speed
            damping = viscous + micro * math.exp(-ratio * ratio)
            u += h * (contact(y - at, u - base, gap, omega) + force / mass)
            u /= 1.0 + h * damping / mass
            for i in range(z.size):
                z[i] = yielded(z[i], h * u, reaches[i], exponent)
            y += h * u
        out[k] = y
    return out
