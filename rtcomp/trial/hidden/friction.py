"""What friction hides: how it depends on speed, direction, place, load, rest and time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rtcomp.trial.forces import FRESH
from rtcomp.trial.hidden.secret import Rig, Secret, Size, Sized, either, linear, log_between


def _viscous(chance: np.random.Generator, rig: Rig) -> Sized:
    more = 0.1 * rig.effort / rig.speed

    def at(strength: float) -> Size:
        return {"viscous": rig.physics.viscous + more * strength}, {"coefficient": more * strength}

    return Sized(at)


def _quadratic(chance: np.random.Generator, rig: Rig) -> Sized:
    return linear("quadratic", 0.1 * rig.effort / rig.speed**2, "coefficient")


def _asymmetric(chance: np.random.Generator, rig: Rig) -> Sized:
    return Sized(linear("skew", either(chance) * 0.2, "asymmetry").at, 0.02, 3.0)


def _asymmetric_viscous(chance: np.random.Generator, rig: Rig) -> Sized:
    def at(strength: float) -> Size:
        ratio = 1.0 + strength
        return {"backward_viscous": ratio}, {"ratio": ratio}

    return Sized(at, 0.02, 60.0)


def _stribeck(chance: np.random.Generator, rig: Rig) -> Sized:
    speed = rig.speed * log_between(chance, 0.1, 0.5)

    def at(strength: float) -> Size:
        rise = 0.2 * strength
        return {"stribeck": rise, "stribeck_speed": speed}, {"rise": rise, "velocity": speed}

    return Sized(at, most=4.0)


def _place(chance: np.random.Generator, rig: Rig) -> Sized:
    if chance.random() < 0.25:
        sign = either(chance)

        def sloped(strength: float) -> Size:
            slope = sign * 0.2 * strength / rig.stroke
            return {"place_slope": slope}, {"slope": slope}

        return Sized(sloped, most=4.0)
    period = rig.stroke * log_between(chance, 0.2, 1.2)
    phase = chance.uniform(0.0, 2.0 * np.pi)

    def periodic(strength: float) -> Size:
        amplitude = 0.15 * strength
        changes = {"place": amplitude, "place_period": period, "place_phase": phase}
        return changes, {"amplitude": amplitude, "period": period, "phase": phase}

    return Sized(periodic, most=5.0)


def _load(chance: np.random.Generator, rig: Rig) -> Sized:
    return Sized(linear("load_friction", 0.2, "coefficient").at, most=3.0)


def _softening(chance: np.random.Generator, rig: Rig) -> Sized:
    return Sized(linear("softening", 1.0, "softening").at, most=6.0)


def _lagged(chance: np.random.Generator, rig: Rig) -> Sized:
    return Sized(linear("friction_lag", 0.02, "time_constant").at, 0.05, 10.0)


def _known_stribeck(chance: np.random.Generator, rig: Rig) -> tuple[dict[str, float], dict[str, Any]]:
    rise, speed = chance.uniform(0.2, 0.5), rig.speed * log_between(chance, 0.2, 0.5)
    changes = {"stribeck": rise, "stribeck_speed": speed}
    return changes, {"name": "stribeck", "rise": rise, "velocity": speed}


def _ageing(chance: np.random.Generator, rig: Rig) -> Sized:
    distance = rig.physics.reach * log_between(chance, 0.2, 1.0)

    def at(strength: float) -> Size:
        by_decade = 0.08 * strength
        changes = {"ageing": by_decade, "ageing_distance": distance}
        return changes, {"growth": by_decade / math.log(10.0), "distance": distance, "onset": FRESH}

    return Sized(at, most=6.0)


def _drift(chance: np.random.Generator, rig: Rig) -> Sized:
    constant, sign = rig.seconds * log_between(chance, 0.15, 0.7), either(chance)

    def at(strength: float) -> Size:
        change = sign * 0.15 * strength
        return {"drift": change, "drift_time": constant}, {"change": change, "time_constant": constant}

    return Sized(at, most=4.0)


def _creep(chance: np.random.Generator, rig: Rig) -> Sized:
    constant = log_between(chance, 0.1, 1.0)

    def at(strength: float) -> Size:
        fraction = 0.2 * strength
        return {"creep": fraction, "creep_time": constant}, {
            "fraction": fraction,
            "time_constant": constant,
        }

    return Sized(at, most=4.0)


FRICTION = (
    Secret("viscous-friction", _viscous, ("coefficient",), retuning=True),
    Secret("quadratic-drag", _quadratic, ("coefficient",)),
    Secret("asymmetric-friction", _asymmetric),
    Secret("asymmetric-viscous-friction", _asymmetric_viscous),
    Secret("stribeck", _stribeck, ("rise", "velocity")),
    Secret("position-dependent-friction", _place, ("amplitude", "period", "slope"), "period"),
    Secret("load-dependent-friction", _load, ("coefficient",)),
    Secret("non-congruent-friction", _softening),
    Secret("frictional-lag", _lagged, ("time_constant",), known=_known_stribeck),
    Secret("stiction-ageing", _ageing, ("growth", "distance", "onset")),
    Secret("friction-drift", _drift, ("change", "time_constant")),
    Secret("creep", _creep),
)
