"""Heavy axes on a screw: friction close to Coulomb's, moves from point to point."""

from __future__ import annotations

import math

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.trial.axis import Loop, Physics
from rtcomp.trial.families.family import Family, Motion, log_uniform, pid

SIGHT = 40.0
"""Hz; above, counts of a heavy mass's acceleration are larger than the forces of its moves."""


def draw_stage(chance: np.random.Generator) -> tuple[Loop, Physics, Motion]:
    """Draw an axis of 0.1 to 0.8 t, its loop and how it is to move."""
    rate = float(chance.choice([500.0, 1000.0]))
    mass, level = log_uniform(chance, 100.0, 800.0), log_uniform(chance, 60.0, 400.0)
    stroke, speed = chance.uniform(0.05, 0.25), chance.uniform(0.1, 0.4)
    acceleration = level * chance.uniform(0.5, 2.0) / mass
    speed = min(speed, math.sqrt(acceleration * stroke))
    resolution = float(chance.choice([1e-7, 5e-7, 1e-6]))
    reach = log_uniform(chance, max(5e-6, 15.0 * resolution), 4e-5)
    viscous = level * chance.uniform(0.1, 0.6) / speed
    peak = level + mass * acceleration + viscous * speed
    physics = Physics(
        mass, peak / chance.uniform(3.0, 6.0), 10.0, viscous, 0.0, 0.1 * speed, level, reach,
        chance.uniform(1.2, 2.0),
    )  # fmt: skip
    omega = min(chance.uniform(25.0, 60.0), rate / 10.0)
    gains = pid(chance, physics, omega, (2.0, 5.0))
    motion = {
        "seconds": chance.uniform(30.0, 60.0), "stroke": stroke, "speed": speed, "acceleration": acceleration,
    }  # fmt: skip
    return Loop(*gains, rate, 0.3 * resolution, resolution, cut=SIGHT), physics, motion


def moves(chance: np.random.Generator, loop: Loop, motion: Motion) -> Floats:
    """Return trapezoidal moves from point to point with rests between, from and to zero, (K,)."""
    tick, place, time = 1.0 / loop.rate, 0.0, 0.0
    parts: list[Floats] = []
    stroke = motion["stroke"]
    while True:
        to = float(chance.uniform(-1.0, 1.0)) * stroke
        if chance.random() < 0.25:  # a short one
            to = float(np.clip(place + chance.uniform(-0.1, 0.1) * stroke, -stroke, stroke))
        speed = motion["speed"] * log_uniform(chance, 0.1, 1.0)
        rest = log_uniform(chance, 0.05, 1.0)
        move = _trapezoid(place, to, speed, motion["acceleration"] * chance.uniform(0.5, 1.0), tick)
        home = _trapezoid(to, 0.0, motion["speed"], motion["acceleration"], tick)
        more = move.size * tick + rest
        if parts and time + more + home.size * tick > motion["seconds"]:
            parts.append(_trapezoid(place, 0.0, motion["speed"], motion["acceleration"], tick))
            parts.append(np.zeros(round(0.3 * loop.rate)))
            return np.concatenate(parts)
        parts += [move, np.full(round(rest * loop.rate), to)]
        place, time = to, time + more


def _trapezoid(start: float, to: float, speed: float, acceleration: float, tick: float) -> Floats:
    """Return a move whose speed is a trapezium, or a triangle where it is short."""
    way = abs(to - start)
    top = max(min(speed, math.sqrt(way * acceleration)), 1e-9)
    rise = top / acceleration
    whole = way / top + rise
    t = np.arange(1, math.ceil(whole / tick) + 1) * tick
    gone = 0.5 * acceleration * np.minimum(t, rise) ** 2 + top * np.clip(t - rise, 0.0, whole - 2.0 * rise)
    late = np.clip(t - (whole - rise), 0.0, rise)
    gone += top * late - 0.5 * acceleration * late**2
    return np.asarray(start + math.copysign(1.0, to - start) * np.minimum(gone, way))


FAMILY = Family(
    "heavy-screw", "heavy axis, friction close to Coulomb's, trapezoidal moves", draw_stage, moves
)
