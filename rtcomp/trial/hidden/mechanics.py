"""What mechanics hides, and what pushes from outside: mass, spring, weight, stop, play, resonance, tone."""

from __future__ import annotations

import numpy as np

from rtcomp.trial.hidden.secret import Rig, Secret, Size, Sized, either, linear, log_between


def _inertia(chance: np.random.Generator, rig: Rig) -> Sized:
    sign = either(chance)

    def at(strength: float) -> Size:
        mass = rig.physics.mass * (1.0 + 0.3 * strength) ** sign
        return {"mass": mass}, {"mass": mass}

    return Sized(at, 0.5, 3.0)


def _spring(chance: np.random.Generator, rig: Rig) -> Sized:
    # Of a spring that is believed, only another law is missing.
    cubic = chance.random() < 0.25 or rig.physics.spring != 0.0

    def at(strength: float) -> Size:
        edge = 0.2 * rig.effort * strength
        if cubic:
            return {"spring_cubic": edge / rig.stroke**3}, {"cubic": edge / rig.stroke**3}
        return {"spring": edge / rig.stroke}, {"stiffness": edge / rig.stroke}

    return Sized(at)


def _gravity(chance: np.random.Generator, rig: Rig) -> Sized:
    if not rig.rotary:
        return linear("weight", either(chance) * 0.1 * rig.effort, "force")
    more, phase = 0.2 * rig.effort, chance.uniform(0.0, 2.0 * np.pi)
    known = rig.physics.pendulum * np.exp(1j * rig.physics.pendulum_phase)

    def at(strength: float) -> Size:
        whole = known + more * strength * np.exp(1j * phase)
        changes = {"pendulum": float(abs(whole)), "pendulum_phase": float(np.angle(whole))}
        return changes, {"amplitude": more * strength, "phase": phase}

    return Sized(at)


def _end_stop(chance: np.random.Generator, rig: Rig) -> Sized:
    place = either(chance) * rig.stroke * chance.uniform(0.35, 0.7)

    def at(strength: float) -> Size:
        stiffness = rig.effort / rig.stroke * strength
        changes = {"stop_position": place, "stop_stiffness": stiffness}
        return changes, {"position": place, "stiffness": stiffness}

    return Sized(at)


def _backlash(chance: np.random.Generator, rig: Rig) -> Sized:
    share = chance.uniform(0.3, 0.6)

    def at(strength: float) -> Size:
        gap = 0.1 * rig.physics.reach * strength
        load = share * rig.physics.mass
        contact = 4.0 * rig.physics.level * rig.physics.shape / rig.physics.reach
        damping = 0.2 * np.sqrt(contact * load)
        changes = {"gap": gap, "second_mass": load, "second_stiffness": contact, "second_damping": damping}
        return changes, {"gap": gap}

    return Sized(at, 0.02, 20.0)


def _resonance(chance: np.random.Generator, rig: Rig) -> Sized:
    frequency = min(log_between(chance, 8.0, 60.0), rig.loop.rate / 12.0)
    damping = chance.uniform(0.01, 0.06)

    def at(strength: float) -> Size:
        # Its share of the moving mass, which stays what it was.
        share = 0.25 * strength / (1.0 + 0.25 * strength)
        second = share * rig.physics.mass
        omega = 2.0 * np.pi * frequency
        changes = {
            "second_mass": second,
            "second_stiffness": second * omega**2,
            "second_damping": 2.0 * damping * omega * second,
        }
        return changes, {"frequency": frequency, "damping": damping, "mass_ratio": share}

    return Sized(at, 0.05, 4.0)


def _tone(chance: np.random.Generator, rig: Rig) -> Sized:
    frequency = min(log_between(chance, 3.0, 60.0), rig.loop.rate / 12.0)
    phase = chance.uniform(0.0, 2.0 * np.pi)

    def at(strength: float) -> Size:
        amplitude = 0.1 * rig.effort * strength
        changes = {"tone": amplitude, "tone_frequency": frequency, "tone_phase": phase}
        return changes, {"amplitude": amplitude, "frequency": frequency}

    return Sized(at)


def _bias(chance: np.random.Generator, rig: Rig) -> Sized:
    return linear("bias", either(chance) * 0.1 * rig.effort, "force")


MECHANICS = (
    Secret("inertia", _inertia, ("mass",), retuning=True),
    Secret("parallel-spring", _spring, ("stiffness", "cubic")),
    Secret("gravity", _gravity, ("force",)),
    Secret("end-stop", _end_stop, ("position", "stiffness")),
    Secret("backlash", _backlash, ("gap",)),
    Secret("resonance", _resonance, ("frequency", "mass_ratio")),
    Secret("tonal-disturbance", _tone, ("amplitude", "frequency"), "frequency"),
    Secret("constant-force", _bias, ("force",)),
)
