"""Motions made of strokes between turning points, each from rest to rest, reversals at finite acceleration.

At a turning point the braking of one stroke and the start of the next are the same acceleration, so that a
reversal is one smooth arc and the turning point is reached exactly.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from rtcomp.kernels import Floats

Shape = Literal["triangle", "sine"]


class Strokes:
    """Strokes through `points` (m, shape (n + 1,)), taking `times` (s, shape (n,)), with profile `shape`.

    triangle: constant acceleration over half the share `corner` of a stroke's time at each end, constant
    speed between. sine: half a cosine. With `cycle` the strokes from point `cycle` on repeat for ever (the
    last point must be that one); without, the motion ends at rest at the last point.
    """

    def __init__(
        self,
        points: Sequence[float],
        times: Sequence[float],
        corners: Sequence[float],
        shape: Shape,
        cycle: int | None = None,
    ) -> None:
        self.points = np.array(points, dtype=np.float64)
        self.times = np.array(times, dtype=np.float64)
        self.corners = np.array(corners, dtype=np.float64)
        self.shape = shape
        self.knots = np.concatenate([[0.0], np.cumsum(self.times)])
        self._prelude = float(self.knots[cycle]) if cycle is not None else 0.0
        self.period: float | None = float(self.knots[-1] - self._prelude) if cycle is not None else None
        self.length: float | None = float(self.knots[-1]) if cycle is None else None

    def evaluate(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Return position, velocity and acceleration; at rest before 0 and after the end."""
        t = np.asarray(t, dtype=np.float64)
        u = np.maximum(t, 0.0)
        if self.period is not None:
            late = u >= self.knots[-1]
            u = np.where(late, self._prelude + np.mod(u - self._prelude, self.period), u)
            over = np.zeros_like(late)
        else:
            over = u >= self.knots[-1]
        n = np.clip(np.searchsorted(self.knots, u, side="right") - 1, 0, self.times.size - 1)
        time = self.times[n]
        way = self.points[n + 1] - self.points[n]
        # Each stroke is symmetric about its middle: measure from the nearer end.
        s = np.clip((u - self.knots[n]) / time, 0.0, 1.0)
        second = s > 0.5
        near = np.where(second, 1.0 - s, s)
        if self.shape == "sine":
            p = 0.5 - 0.5 * np.cos(math.pi * near)
            v = 0.5 * math.pi * np.sin(math.pi * near)
            a = 0.5 * math.pi**2 * np.cos(math.pi * near)
        else:
            arc = 0.5 * self.corners[n]
            speed = 1.0 / (1.0 - arc)
            inside = near < arc
            p = np.where(inside, 0.5 * speed / arc * near**2, speed * (near - 0.5 * arc))
            v = np.where(inside, speed / arc * near, speed)
            a = np.where(inside, speed / arc, 0.0)
        x = np.where(second, self.points[n + 1] - way * p, self.points[n] + way * p)
        v = way * v / time
        a = np.where(second, -1.0, 1.0) * way * a / time**2
        still = (t < 0.0) | over
        x = np.where(over, self.points[-1], x)
        return x, np.where(still, 0.0, v), np.where(still, 0.0, a)

    def landmarks(self, _until: float) -> Floats:
        """Return both ends, both arcs and the middle of every stroke."""
        places = np.array([0.0, 1e-9, 0.5 - 1e-9, 0.5, 0.5 + 1e-9, 1.0 - 1e-9])
        times: Floats = (self.knots[:-1, None] + self.times[:, None] * places).ravel()
        return times


def at_speed(
    points: Sequence[float], speed: float, acceleration: float, shape: Shape
) -> tuple[list[float], list[float]]:
    """Return times (s) and corner shares of strokes through `points` (m) at one speed and acceleration.

    triangle: cruise at `speed` (m/s) where the stroke is long enough to reach it. sine: times such that the
    acceleration (m/s^2) at every turning point is the same, so that it does not jump there.
    """
    times, corners = [], []
    for a, b in itertools.pairwise(points):
        way = abs(b - a)
        if shape == "sine":
            times.append(math.pi * math.sqrt(way / (2.0 * acceleration)))
            corners.append(1.0)
        elif way >= speed * speed / acceleration:
            times.append(way / speed + speed / acceleration)
            corners.append(min(2.0 * speed / acceleration / times[-1], 1.0))
        else:
            times.append(2.0 * math.sqrt(way / acceleration))
            corners.append(1.0)
    return times, corners


def decaying(first: float, ratio: float, count: int) -> Sequence[float]:
    """Return `count` amplitudes (m), each `ratio` times the one before."""
    return [first * ratio**k for k in range(count)]


def nested(
    start: float,
    offset: float,
    amplitudes: Sequence[float],
    *,
    direction: int,
    repeats: int,
    speed: float | None,
    stroke_time: float | None,
    corner: float,
    shape: Shape,
) -> Strokes:
    """Return reversals at offset +- amplitudes (m), alternating, from `start` to rest at `offset`."""
    points = [start]
    for _ in range(repeats):
        sign = direction
        for amplitude in amplitudes:
            points.append(offset + sign * amplitude)
            sign = -sign
        points.append(offset)
    points = _moving(points)
    count = len(points) - 1
    if stroke_time is not None:
        return Strokes(points, [stroke_time] * count, [corner] * count, shape)
    assert speed is not None
    longest = max(abs(b - a) for a, b in itertools.pairwise(points))
    if shape == "sine":
        # The longest stroke peaks at `speed`: v = pi D / (2 T), a = pi^2 D / (2 T^2).
        acceleration = 2.0 * speed * speed / longest
    else:
        time = longest / (speed * (1.0 - corner / 2.0))
        acceleration = speed / (corner * time / 2.0)
    return Strokes(points, *at_speed(points, speed, acceleration, shape), shape)


def minor_loops(
    start: float,
    offset: float,
    amplitude: float,
    frequency: float,
    up: Sequence[tuple[float, float]],
    down: Sequence[tuple[float, float]],
    corner: float,
    shape: Shape,
) -> Strokes:
    """Return a major loop of +-amplitude (m) about offset with minor loops (position, size) on its branches.

    From `start` to the lower end first; then cycles. Positions are counted from `offset`.
    """
    ascent = [q for position, size in sorted(up) for q in (position, position - size)]
    descent = [q for position, size in sorted(down, reverse=True) for q in (position, position + size)]
    cycle = [-amplitude, *ascent, amplitude, *descent, -amplitude]
    points = _moving([start, *(offset + q for q in cycle)])
    half = 0.5 / frequency
    if shape == "sine":
        speed = math.pi * amplitude / half
        acceleration = math.pi**2 * amplitude / half**2
    else:
        speed = 2.0 * amplitude / (half * (1.0 - corner / 2.0))
        acceleration = speed / (corner * half / 2.0)
    first = 1 if points[1] == points[-1] and points[0] != points[1] else 0
    return Strokes(points, *at_speed(points, speed, acceleration, shape), shape, cycle=first)


def _moving(points: Sequence[float]) -> list[float]:
    """Return the points without those that repeat the one before."""
    kept = [points[0]]
    kept += [b for a, b in itertools.pairwise(points) if b != a]
    return kept if len(kept) > 1 else [points[0], points[0]]


def smooth_step(s: Floats) -> tuple[Floats, Floats, Floats]:
    """Return 10 s^3 - 15 s^4 + 6 s^5 and its two derivatives, 0 before s = 0 and 1 after s = 1."""
    q = np.clip(s, 0.0, 1.0)
    value = q**3 * (10.0 + q * (6.0 * q - 15.0))
    return value, 30.0 * q**2 * (1.0 - q) ** 2, 60.0 * q * (1.0 - q) * (1.0 - 2.0 * q)
