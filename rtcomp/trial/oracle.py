"""What a hidden effect does to the force balance: its strength, and whether it stands out of the noise.

The balance here is the trial's own, on the plant's exact parameters, which no diagnosis has.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.trial.axis import Loop, Physics
from rtcomp.trial.friction import ELEMENTS, along, stop_elements, stops_along
from rtcomp.trial.plant import Run

SETTLE_S = 0.3
"""Left out at both ends of a run: filters and memory settle."""
OFF = 0.1
"""Part by which what is believed of each stop element may be off."""
FURTHER = 0.05
"""Part of the reach by which the tangent of it goes further."""
STEPS, STEP, NEAR = 3, 1.6, 1.03
"""Steps at most to the reach that fits best, the factor on it that a step is at most, and at least."""


@dataclass(frozen=True)
class Balance:
    """Residual force (N, (K,)), the motion side (N, (K,)), and what retuning can take up.

    `tangents` (N, (K, R)) as far as it likes, the last that of the reach; `stops` (N, (K, n)) by the part OFF
    of each. `level` (N) is that of friction.
    """

    residual: Floats
    needed: Floats
    tangents: Floats
    stops: Floats
    level: float

    @functools.cached_property
    def _retuning(self) -> tuple[Floats, float]:
        """The residual less the best retuning, (K,), and the factor on the reach that this suggests."""
        from scipy.optimize import lsq_linear

        scale = np.sqrt(np.mean(self.tangents**2, axis=0))
        scale = np.where(scale > 0.0, scale, 1.0)
        basis = np.column_stack([self.tangents / scale, self.stops])
        most = np.append(np.full(scale.size, np.inf), np.full(self.stops.shape[1], OFF))
        # Its triangle has all that the squares depend on, in as many rows as there are columns.
        q, r = np.linalg.qr(basis)
        weights = lsq_linear(r, q.T @ self.residual, (-most, most)).x
        further = FURTHER * float(weights[scale.size - 1] / scale[-1]) / self.level
        return np.asarray(self.residual - basis @ weights), min(max(1.0 + further, 1.0 / STEP), STEP)

    @property
    def retuned(self) -> Floats:
        """The residual less the best retuning, (K,).

        That is one of mass, damping, friction level and reach (as its tangent goes), and of the stiffness of
        each stop element that the belief gives friction by: it is off by as much as the rest of the belief.
        """
        return self._retuning[0]

    @property
    def stretch(self) -> float:
        """The factor on the reach that retuning suggests."""
        return self._retuning[1]


def balance(physics: Physics, loop: Loop, run: Run, position: Floats) -> Balance:
    """Return the balance of `physics` (without effects) on `position` (m, (K,)) and the run's voltage."""
    from scipy.signal import butter, sosfiltfilt

    cut = loop.cut or min(max(100.0, 0.025 * loop.rate), 0.1 * loop.rate)
    sections = butter(3, cut, fs=loop.rate, output="sos")

    def smooth(signal: Floats) -> Floats:
        return np.asarray(sosfiltfilt(sections, signal))

    slow = smooth(position)
    velocity = np.gradient(slow) * loop.rate
    acceleration = np.zeros_like(slow)
    acceleration[1:-1] = np.diff(slow, 2) * loop.rate**2
    held = 0.5 * (run.voltage + np.append(run.voltage[:1], run.voltage[:-1]))
    memory, further = np.zeros(slow.size), np.zeros(slow.size)
    g = 1.0 + physics.stribeck * np.exp(-((velocity / physics.stribeck_speed) ** 2))
    warped = np.cumsum(np.diff(position, prepend=position[0]) / g)
    along(warped, physics.reach, physics.shape, memory)
    along(warped, (1.0 + FURTHER) * physics.reach, physics.shape, further)
    micro = np.exp(-((velocity / physics.micro_speed) ** 2)) * velocity
    drive = smooth(physics.force_constant * held)
    rest = physics.level * g * memory + physics.viscous * velocity + physics.micro_damping * micro
    known, springs = _springs(physics, slow)
    needed = smooth(physics.mass * acceleration + rest + known)
    columns = [acceleration, velocity, micro, g * memory, *springs, g * (further - memory)]
    edge = int(SETTLE_S * loop.rate)
    inside = slice(edge, slow.size - edge)
    tangents = np.column_stack([smooth(c)[inside] for c in columns])
    elements = np.array(stop_elements(physics.level, physics.reach, physics.shape, ELEMENTS))
    stops = stops_along(warped, elements[:, 0].copy(), elements[:, 1].copy())
    held_by = np.column_stack([smooth(g * stop)[inside] for stop in stops.T])
    return Balance((drive - needed)[inside], needed[inside], tangents, held_by, physics.level)


def _springs(physics: Physics, position: Floats) -> tuple[Floats, list[Floats]]:
    """Return the force (N, (K,)) of a known spring and pendulum, and what retuning can make of it."""
    force, tangents = np.zeros(position.size), []
    if physics.spring != 0.0:
        force += physics.spring * position
        tangents.append(position)
    if physics.pendulum != 0.0:
        force -= physics.pendulum * np.sin(position + physics.pendulum_phase)
        tangents += [np.sin(position), np.cos(position)]
    return force, tangents


@dataclass(frozen=True)
class Strength:
    """Of an effect in a recording, as parts of the rms force of the motion.

    `share` is what the believed parameters leave, `beyond` what no retuning takes up, both above what the
    balance leaves of a stage without it; `floor` what noise and sampling leave without any effect.
    """

    share: float
    beyond: float
    floor: float

    def detectability(self, retuning: bool) -> float:
        """Return the rms of the effect over that of the floor; of a retuning all of it counts."""
        return (self.share if retuning else self.beyond) / self.floor


@dataclass(frozen=True)
class Bare:
    """A stage without anything hidden, and the rms (N) of its forces and of what its own balance leaves."""

    physics: Physics
    loop: Loop
    needed: float
    floor: float
    """As recorded, with noise and resolution."""
    share: float
    beyond: float
    """Along its true motion, as believed and retuned: what sampling leaves."""

    @classmethod
    def of(cls, physics: Physics, loop: Loop, clean: Run) -> Bare:
        """Take the balance of a run of the stage without anything hidden."""
        recorded = balance(physics, loop, clean, clean.position)
        share, beyond = _left(physics, loop, clean)
        return cls(physics, loop, _rms(recorded.needed), _rms(recorded.retuned), share, beyond)

    def strength(self, hidden: Run) -> Strength:
        """Return the strength of what `hidden` has and this stage has not."""
        share, beyond = _left(self.physics, self.loop, hidden)
        return Strength(
            _above(share, self.share) / self.needed,
            _above(beyond, self.beyond) / self.needed,
            self.floor / self.needed,
        )


def _left(physics: Physics, loop: Loop, run: Run) -> tuple[float, float]:
    """Return what the true motion leaves of the balance, rms (N): as it is, and after retuning.

    The reach is retuned as far as it likes, and its tangent leads only a step.
    """
    seen = balance(physics, loop, run, run.truth)
    share, least = _rms(seen.residual), _rms(seen.retuned)
    for _ in range(STEPS):
        if 1.0 / NEAR < seen.stretch < NEAR:
            break
        physics = physics._replace(reach=physics.reach * seen.stretch)
        seen = balance(physics, loop, run, run.truth)
        least = min(least, _rms(seen.retuned))
    return share, least


def _above(rms: float, own: float) -> float:
    """Return the rms of what an effect adds to the balance's `own`: their squares add up."""
    return float(np.sqrt(max(rms**2 - own**2, 0.0)))


def _rms(signal: Floats) -> float:
    return float(np.sqrt(np.mean(signal**2)))
