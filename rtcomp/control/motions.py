"""Motions that repeat: position, velocity and acceleration at any time.

A `Motion` is defined for all times of its own, begins at 0 and knows nothing of delay, fade or limits;
`rtcomp.control.references` puts those around it.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Protocol

import numpy as np

from rtcomp.kernels import Floats

Triple = tuple[Floats, Floats, Floats]
"""Position (m), velocity (m/s), acceleration (m/s^2), of one shape."""


class Motion(Protocol):
    """A motion of its own time (s), from 0 on."""

    period: float | None
    """s, where it repeats."""
    length: float | None
    """s, where it ends (at rest, and stays there)."""

    def evaluate(self, t: Floats) -> Triple:
        """Return position, velocity and acceleration at the times `t` (s), any shape."""

    def landmarks(self, until: float, /) -> Floats:
        """Return times (s) that show every extreme: of one period, of all its length, or `until` (s)."""


class Harmonics:
    """Sum of sines: amplitudes (m), frequencies (Hz), phases (rad)."""

    def __init__(self, amplitudes: Floats, frequencies: Floats, phases: Floats) -> None:
        self.amplitudes, self.phases = amplitudes, phases
        self.omegas = 2.0 * math.pi * frequencies
        self.period: float | None = _common_period(frequencies)
        self.length: float | None = None
        self._highest = float(frequencies.max())

    @classmethod
    def schroeder(cls, low: float, high: float, count: int, peak: float) -> Harmonics:
        """Return equal sines with phases -pi k (k - 1) / n (Schroeder, IEEE Trans. IT 16(1), 1970).

        They keep the crest low; the sum is scaled so that its largest value is `peak` (m).
        """
        k = np.arange(1, count + 1, dtype=np.float64)
        until = 100.0 * count / (high - low)  # only where the frequencies have no common period
        made = cls(np.ones(count), np.linspace(low, high, count), -math.pi * k * (k - 1.0) / count)
        made.amplitudes = made.amplitudes * (
            peak / float(np.abs(made.evaluate(made.landmarks(until))[0]).max())
        )
        return made

    def evaluate(self, t: Floats) -> Triple:
        """Return the sum and its derivatives."""
        x, v, a = (np.zeros_like(t) for _ in range(3))
        for amplitude, omega, phase in zip(self.amplitudes, self.omegas, self.phases, strict=True):
            sine, cosine = np.sin(omega * t + phase), np.cos(omega * t + phase)
            x += amplitude * sine
            v += amplitude * omega * cosine
            a -= amplitude * omega * omega * sine
        return x, v, a

    def landmarks(self, until: float) -> Floats:
        """Return 256 times in each period of the fastest sine, over one common period or `until`."""
        span = until if self.period is None else min(self.period, until)
        return np.linspace(0.0, span, int(min(max(256 * span * self._highest, 256), 1e6)) + 1)


def _common_period(frequencies: Floats) -> float | None:
    """Return the shortest time (s) in which every frequency (Hz) makes whole turns, if below an hour."""
    parts = [Fraction(float(f)).limit_denominator(1_000_000) for f in frequencies]
    if any(abs(float(p) - f) > 1e-9 * f for p, f in zip(parts, frequencies, strict=True)):
        return None
    bottom = math.lcm(*(p.denominator for p in parts))
    base = Fraction(math.gcd(*(int(p * bottom) for p in parts)), bottom)
    return float(1 / base) if base > Fraction(1, 3600) else None


class RoundedTriangle:
    """Triangle between +-amplitude (m) whose corners are arcs of constant acceleration.

    Like a sine it passes 0 upwards at phase 0. The arcs take the share `corner` of the time; the straight
    parts run at 4 f A / (1 - corner / 2), so that the extremes are reached exactly.
    """

    def __init__(self, amplitude: float, frequency: float, phase: float, corner: float) -> None:
        self.amplitude, self.phase, self.corner = amplitude, phase, corner
        self.period: float | None = 1.0 / frequency
        self.length: float | None = None
        self._frequency = frequency
        self.speed = 4.0 * frequency * amplitude / (1.0 - corner / 2.0)
        self.acceleration = self.speed / (corner / (4.0 * frequency))

    def evaluate(self, t: Floats) -> Triple:
        """Return the wave and its derivatives; the acceleration jumps where arcs begin and end."""
        turn = t * self._frequency + self.phase / (2.0 * math.pi) + 0.25
        turn = turn - np.floor(turn)
        # Half a turn up, from the lower corner at 0, then its mirror image.
        falling = turn >= 0.5
        sign = np.where(falling, -1.0, 1.0)
        u = np.where(falling, turn - 0.5, turn) / self._frequency
        # Symmetric about the middle of the stroke: measure time and position from there.
        from_middle = u - 0.25 / self._frequency
        side = np.sign(from_middle)
        to_corner = np.maximum(0.25 / self._frequency - np.abs(from_middle), 0.0)
        arc = self.corner / (4.0 * self._frequency)
        inside = to_corner < arc
        x = np.where(
            inside,
            side * (self.amplitude - 0.5 * self.acceleration * to_corner**2),
            self.speed * from_middle,
        )
        v = np.where(inside, self.acceleration * to_corner, self.speed)
        a = np.where(inside, -side * self.acceleration, 0.0)
        return sign * x, sign * v, sign * a

    def landmarks(self, _until: float) -> Floats:
        """Return 2048 times of one period, and both ends of every arc from both sides."""
        period = 1.0 / self._frequency
        arcs = [0.25 * period * n + s * 0.25 * period * self.corner for n in (1, 3) for s in (-1, 0, 1)]
        shifted = (np.array(arcs) - self.phase / (2 * math.pi) * period) % period
        near = np.concatenate([shifted * (1 - 1e-9), shifted, shifted * (1 + 1e-9)])
        return np.sort(np.concatenate([np.linspace(0.0, period, 2049), near]))


class Still:
    """No motion: at `position` (m)."""

    period: float | None = None

    def __init__(self, position: float, length: float) -> None:
        self.position = position
        self.length: float | None = length

    def evaluate(self, t: Floats) -> Triple:
        """Return `position`, and no velocity or acceleration."""
        return np.full_like(t, self.position), np.zeros_like(t), np.zeros_like(t)

    def landmarks(self, _until: float) -> Floats:
        """Return one time."""
        return np.zeros(1)
