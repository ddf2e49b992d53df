"""What a drive hides: offset, gain, dead band, saturation, lateness, back-EMF, ripple, cogging."""

from __future__ import annotations

import numpy as np

from rtcomp.trial.hidden.secret import Rig, Secret, Size, Sized, either, linear, log_between


def _offset(chance: np.random.Generator, rig: Rig) -> Sized:
    volts = 0.1 * rig.effort / rig.physics.force_constant
    return linear("offset", either(chance) * volts, "offset")


def _gain(chance: np.random.Generator, rig: Rig) -> Sized:
    sign = either(chance)

    def at(strength: float) -> Size:
        gain = (1.0 + 0.2 * strength) ** sign
        return {"force_constant": rig.physics.force_constant * gain}, {"gain": gain}

    return Sized(at, 0.5, 3.0)


def _deadband(chance: np.random.Generator, rig: Rig) -> Sized:
    sized = linear("deadband", 0.1 * rig.volts, "width")
    return Sized(sized.at, most=4.0)


def _saturation(chance: np.random.Generator, rig: Rig) -> Sized:
    floor = 1.05 * rig.physics.level / rig.physics.force_constant

    def at(strength: float) -> Size:
        limit = floor + (rig.volts - floor) / (1.0 + strength)
        return {"saturation": limit}, {"limit": limit}

    return Sized(at, 0.02, 20.0)


def _delay(chance: np.random.Generator, rig: Rig) -> Sized:
    return Sized(linear("delay", 1.0 / rig.loop.rate, "delay").at, 0.2, 4.0)


def _lag(chance: np.random.Generator, rig: Rig) -> Sized:
    return Sized(linear("lag", 1.5e-3, "time_constant").at, 0.1, 4.0)


def _back_emf(chance: np.random.Generator, rig: Rig) -> Sized:
    return linear("back_emf", 0.1 * rig.effort / rig.speed, "coefficient")


def _ripple(chance: np.random.Generator, rig: Rig) -> Sized:
    period = rig.stroke * log_between(chance, 0.15, 0.9)
    phase = chance.uniform(0.0, 2.0 * np.pi)

    def at(strength: float) -> Size:
        shape = {"period": period, "phase": phase}
        amplitude = 0.1 * strength
        changes = {"ripple": amplitude, "ripple_period": period, "ripple_phase": phase}
        return changes, {"amplitude": amplitude, **shape}

    return Sized(at, most=6.0)


def _cogging(chance: np.random.Generator, rig: Rig) -> Sized:
    period = rig.stroke * log_between(chance, 0.1, 0.9)
    phase = chance.uniform(0.0, 2.0 * np.pi)
    second = 0.3 if chance.random() < 0.25 else 0.0

    def at(strength: float) -> Size:
        amplitude = 0.1 * rig.effort * strength
        changes = {"cogging": amplitude, "cogging_period": period, "cogging_phase": phase}
        return changes | {"cogging_second": second}, {
            "amplitude": amplitude, "period": period, "phase": phase,
        }  # fmt: skip

    return Sized(at)


DRIVE = (
    Secret("drive-offset", _offset, ("offset",)),
    Secret("drive-gain", _gain, ("gain",), retuning=True),
    Secret("drive-deadband", _deadband, ("width",)),
    Secret("drive-saturation", _saturation, ("limit",)),
    Secret("drive-delay", _delay, ("delay",)),
    Secret("drive-lag", _lag, ("time_constant",)),
    Secret("back-emf", _back_emf, ("coefficient",), retuning=True),
    Secret("torque-ripple", _ripple, ("amplitude", "period"), "period"),
    Secret("cogging", _cogging, ("amplitude", "period"), "period"),
)
