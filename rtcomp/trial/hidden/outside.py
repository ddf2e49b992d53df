"""Shapes that no catalogue has: to be called unexplained, not to be given the nearest name."""

from __future__ import annotations

import numpy as np

from rtcomp.trial.hidden.secret import Rig, Secret, Size, Sized, either, log_between


def _bump(chance: np.random.Generator, rig: Rig) -> Sized:
    place = rig.stroke * chance.uniform(-0.5, 0.5)
    width, sign = rig.stroke * log_between(chance, 0.05, 0.2), either(chance)

    def at(strength: float) -> Size:
        return {"bump": sign * 0.3 * rig.effort * strength, "bump_place": place, "bump_width": width}, {}

    return Sized(at)


def _speed_bump(chance: np.random.Generator, rig: Rig) -> Sized:
    speed = rig.speed * chance.uniform(0.6, 1.4)

    def at(strength: float) -> Size:
        changes = {"speed_bump_at": speed, "speed_bump_width": 0.2 * speed}
        return changes | {"speed_bump": 0.2 * rig.effort * strength}, {}

    return Sized(at)


def _place_damping(chance: np.random.Generator, rig: Rig) -> Sized:
    place, width = rig.stroke * chance.uniform(-0.5, 0.5), rig.stroke * chance.uniform(0.1, 0.3)

    def at(strength: float) -> Size:
        changes = {"place_damping_at": place, "place_damping_width": width}
        return changes | {"place_damping": 0.5 * rig.effort / rig.speed * strength}, {}

    return Sized(at)


def _walk(chance: np.random.Generator, rig: Rig) -> Sized:
    return Sized(lambda strength: ({"walk": 0.05 * strength}, {}), most=5.0)


def _gain_memory(chance: np.random.Generator, rig: Rig) -> Sized:
    width = rig.volts * chance.uniform(0.1, 0.3)

    def at(strength: float) -> Size:
        return {"gain_memory": 0.3 * strength, "gain_memory_width": width}, {}

    return Sized(at, most=2.5)


def _hump(chance: np.random.Generator, rig: Rig) -> Sized:
    distance = rig.stroke * log_between(chance, 0.1, 0.3)

    def at(strength: float) -> Size:
        return {"hump": 0.2 * rig.effort * strength, "hump_distance": distance}, {}

    return Sized(at)


OUTSIDE = (
    Secret("outside-force-bump", _bump, outside=True),
    Secret("outside-speed-bump", _speed_bump, outside=True),
    Secret("outside-place-damping", _place_damping, outside=True),
    Secret("outside-wandering-gain", _walk, outside=True),
    Secret("outside-gain-hysteresis", _gain_memory, outside=True),
    Secret("outside-distance-hump", _hump, outside=True),
)
