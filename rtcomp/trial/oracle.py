"""What a hidden effect does to the force balance: its strength, and whether it stands out of the noise.

The balance here is the trial's own, on the plant's exact parameters: no diagnosis can do better.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.trial.friction import ELEMENTS, along, stop_elements, stops_along
from rtcomp.trial.plant import Loop, Physics, Run

SETTLE_S = 0.3
"""Left out at both ends of a run: filters and memory settle."""
OFF = 0.1
"""Part by which what is believed of each stop element may be off."""


@dataclass(frozen=True)
class Balance:
    """Residual force (N, (K,)), the motion side (N, (K,)), and what retuning can take up.

    `tangents` (N, (K, R)) as far as it likes, `stops` (N, (K, n)) by the part OFF of each.
    """

    residual: Floats
    needed: Floats
    tangents: Floats
    stops: Floats

    @functools.cached_property
    def retuned(self) -> Floats:
        """The residual less the best retuning, (K,).

        That is one of mass, damping, friction level and reach, and of the stiffness of each stop element that
        the belief gives friction by, which is off by as much as the rest of the belief.
        """
        from scipy.optimize import lsq_linear

        scale = np.sqrt(np.mean(self.tangents**2, axis=0))
        basis = np.column_stack([self.tangents / np.where(scale > 0.0, scale, 1.0), self.stops])
        most = np.append(np.full(scale.size, np.inf), np.full(self.stops.shape[1], OFF))
        # Its triangle has all that the squares depend on, in as many rows as there are columns.
        q, r = np.linalg.qr(basis)
        weights = lsq_linear(r, q.T @ self.residual, (-most, most)).x
        return np.asarray(self.residual - basis @ weights)


def balance(physics: Physics, loop: Loop, run: Run, position: Floats) -> Balance:
    """Return the balance of `physics` (without effects) on `position` (m, (K,)) and the run's voltage."""
    from scipy.signal import butter, sosfiltfilt

    cut = min(100.0, 0.1 * loop.rate)
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
    along(warped, 1.05 * physics.reach, physics.shape, further)
    micro = np.exp(-((velocity / physics.micro_speed) ** 2)) * velocity
    drive = smooth(physics.force_constant * held)
    rest = physics.level * g * memory + physics.viscous * velocity + physics.micro_damping * micro
    needed = smooth(physics.mass * acceleration + rest)
    columns = [acceleration, velocity, micro, g * memory, g * (further - memory)]
    edge = int(SETTLE_S * loop.rate)
    inside = slice(edge, slow.size - edge)
    tangents = np.column_stack([smooth(c)[inside] for c in columns])
    elements = np.array(stop_elements(physics.level, physics.reach, physics.shape, ELEMENTS))
    stops = stops_along(warped, elements[:, 0].copy(), elements[:, 1].copy())
    held_by = np.column_stack([smooth(g * stop)[inside] for stop in stops.T])
    return Balance((drive - needed)[inside], needed[inside], tangents, held_by)


@dataclass(frozen=True)
class Strength:
    """Of an effect in a recording, as parts of the rms force of the motion.

    `share` is what the believed parameters leave, `beyond` what no retuning takes up, `floor` what noise and
    sampling leave without any effect.
    """

    share: float
    beyond: float
    floor: float

    def detectability(self, retuning: bool) -> float:
        """Return the rms of the effect over that of the floor; of a retuning all of it counts."""
        return (self.share if retuning else self.beyond) / self.floor


def strength(physics: Physics, loop: Loop, hidden: Run, bare: Balance) -> Strength:
    """Return the strength of what `hidden` has and the run of the `bare` balance has not."""
    seen = balance(physics, loop, hidden, hidden.truth)
    rms = _rms(bare.needed)
    return Strength(_rms(seen.residual) / rms, _rms(seen.retuned) / rms, _rms(bare.retuned) / rms)


def _rms(signal: Floats) -> float:
    return float(np.sqrt(np.mean(signal**2)))
