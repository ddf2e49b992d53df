"""What a sensor hides: scale, lateness, periodic error, drift, a jump."""

from __future__ import annotations

import numpy as np

from rtcomp.trial.hidden.secret import Rig, Secret, Size, Sized, either, linear, log_between


def _scale(chance: np.random.Generator, rig: Rig) -> Sized:
    sign = either(chance)

    def at(strength: float) -> Size:
        scale = (1.0 + 0.05 * strength) ** sign
        return {"scale": scale}, {"scale": scale}

    return Sized(at, most=6.0)


def _delay(chance: np.random.Generator, rig: Rig) -> Sized:
    return Sized(linear("sensor_delay", 1.0 / rig.loop.rate, "delay").at, 0.2, 4.0)


def _cyclic(chance: np.random.Generator, rig: Rig) -> Sized:
    period = rig.stroke * log_between(chance, 0.02, 0.3)

    def at(strength: float) -> Size:
        # Stays readable: below a slope of one half the reading never runs backwards.
        amplitude = min(0.01 * rig.physics.reach * strength, 0.5 * period / (2.0 * np.pi))
        return {"cyclic": amplitude, "cyclic_period": period}, {"amplitude": amplitude, "period": period}

    return Sized(at)


def _drift(chance: np.random.Generator, rig: Rig) -> Sized:
    constant, sign = rig.seconds * log_between(chance, 0.1, 0.5), either(chance)

    def at(strength: float) -> Size:
        drift = sign * 0.5 * rig.physics.reach * strength
        changes = {"sensor_drift": drift, "sensor_drift_time": constant}
        return changes, {"drift": drift, "time_constant": constant}

    return Sized(at, most=10.0)


def _jump(chance: np.random.Generator, rig: Rig) -> Sized:
    time, sign = rig.seconds * chance.uniform(0.25, 0.75), either(chance)

    def at(strength: float) -> Size:
        size = sign * 0.2 * rig.physics.reach * strength
        return {"jump": size, "jump_time": time}, {"size": size, "time": time}

    return Sized(at, most=10.0)


SENSOR = (
    Secret("sensor-scale", _scale, ("scale",)),
    Secret("sensor-delay", _delay, ("delay",)),
    Secret("sensor-periodic-error", _cyclic, ("amplitude", "period"), "period"),
    Secret("sensor-drift", _drift, ("drift",)),
    Secret("sensor-jump", _jump, ("size", "time")),
)
