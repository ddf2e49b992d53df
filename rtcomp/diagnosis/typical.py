"""How large each entry of the catalogue would plausibly be on the axis at hand, and by which number of it.

Sizes come from the recording: its forces, commands, stroke, speeds and length, and the friction found. They
serve to tell what the recording could not have shown, not to look for what it shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.scene import Entry, Scene

TYPICAL = 0.05
"""Force of an entry that may have any size, over that of the drive, both rms."""


@dataclass(frozen=True)
class Typical:
    """An entry at a modest size, the parameter that is its size, and how many times that is plausible."""

    entry: Entry
    size: str
    most: float
    neutral: float = 0.0
    """Value of that parameter at which the entry changes nothing."""

    @property
    def name(self) -> str:
        """The entry's name."""
        return str(self.entry["name"])

    @property
    def probe(self) -> float:
        """How far the parameter is from doing nothing."""
        value = self.entry[self.size]
        assert isinstance(value, int | float)
        return float(value) - self.neutral


def typical(s: Scene, moment: float) -> list[Typical]:
    """Return every entry that a recording of position and voltage could be asked for.

    `moment` (s) is when something happens that happens once.
    """
    force = float(np.sqrt(np.mean(s.fitted.system.y**2))) or 1.0
    volts = float(np.sqrt(np.mean(s.volts**2)))
    speed = float(np.sqrt(np.mean(s.v**2))) or 1e-9
    small, wave = TYPICAL * force, s.span / 6
    total = float(np.ptp(s.time))
    reaches = s.fitted.ledger.reaches
    top = s.motion.stroke[1]
    mass = s.fitted.ledger.stage.mass
    late = min(2.0 * s.motion.period, 0.1 / s.motion.cut)
    largest = float(np.abs(s.volts).max()) or 1e-9
    push = (small / s.force_constant) or 1e-9
    cut = s.motion.cut
    found = [
        ({"name": "drive-offset", "offset": push}, "offset", 1.0),
        ({"name": "drive-gain", "gain": 1.1}, "gain", 4.0, 1.0),
        ({"name": "drive-deadband", "width": 0.05 * volts}, "width", 10.0),
        ({"name": "drive-saturation", "limit": 0.95 * largest}, "limit", 10.0, largest),
        ({"name": "drive-delay", "delay": late}, "delay", 20.0),
        ({"name": "drive-lag", "time_constant": late}, "time_constant", 20.0),
        ({"name": "torque-ripple", "amplitude": 0.05, "period": wave}, "amplitude", 4.0),
        ({"name": "cogging", "amplitude": small, "period": wave}, "amplitude", 1.0),
        ({"name": "back-emf", "coefficient": small / speed}, "coefficient", 1.0),
        ({"name": "viscous-friction", "coefficient": small / speed}, "coefficient", 1.0),
        ({"name": "quadratic-drag", "coefficient": small / speed**2}, "coefficient", 1.0),
        ({"name": "asymmetric-viscous-friction", "ratio": 0.2}, "ratio", 4.0),
        ({"name": "stribeck", "rise": 0.1, "velocity": float(s.speeds(3)[1])}, "rise", 10.0),
        ({"name": "frictional-lag", "time_constant": 5e-3}, "time_constant", 10.0),
        ({"name": "asymmetric-friction", "asymmetry": 0.05}, "asymmetry", 6.0),
        ({"name": "non-congruent-friction", "softening": 0.1}, "softening", 5.0),
        ({"name": "load-dependent-friction", "coefficient": 0.03}, "coefficient", 10.0),
        ({"name": "position-dependent-friction", "amplitude": 0.1, "period": wave}, "amplitude", 4.0),
        ({"name": "stiction-ageing", "growth": 0.05, "distance": float(reaches[0])}, "growth", 4.0),
        ({"name": "creep", "fraction": 0.1, "time_constant": 0.1}, "fraction", 5.0),
        ({"name": "friction-drift", "change": 0.1, "time_constant": total / 3}, "change", 4.0),
        ({"name": "inertia", "mass": 1.1 * mass}, "mass", 10.0, mass),
        ({"name": "resonance", "frequency": 0.5 * cut, "damping": 0.05, "mass_ratio": 0.1}, "mass_ratio",
         5.0),
        ({"name": "backlash", "gap": 0.1 * float(reaches.max())}, "gap", 10.0),
        ({"name": "parallel-spring", "stiffness": 3 * small / s.span}, "stiffness", 1.0),
        ({"name": "gravity", "force": small}, "force", 1.0),
        ({"name": "constant-force", "force": small}, "force", 1.0),
        ({"name": "bouc-wen", "alpha": 3 * small / s.span, "beta": 6.0 / s.span, "gamma": 0.5, "delta": 0.0},
         "alpha", 1.0),
        ({"name": "end-stop", "position": top - 0.1 * s.span, "stiffness": 50 * small / s.span}, "stiffness",
         10.0),
        ({"name": "tonal-disturbance", "amplitude": 1.4 * small, "frequency": 0.3 * cut}, "amplitude", 1.0),
        ({"name": "sensor-delay", "delay": late}, "delay", 20.0),
        ({"name": "sensor-periodic-error", "amplitude": 1e-3 * wave, "period": wave}, "amplitude", 10.0),
        ({"name": "sensor-drift", "drift": 0.01 * s.span, "time_constant": total / 3}, "drift", 10.0),
        ({"name": "sensor-jump", "size": 0.01 * s.span, "time": moment}, "size", 5.0),
        ({"name": "sensor-scale", "scale": 1.01}, "scale", 3.0, 1.0),
    ]  # fmt: skip
    return [Typical(*item) for item in found]  # type: ignore[arg-type]
