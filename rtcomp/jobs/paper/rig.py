"""The simulated stage in the paper's place: ideal, or with the flaws that Fig. 11 shows."""

from __future__ import annotations

from typing import Any

import numpy as np

from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import friction
from rtcomp.jobs.judge import Friction
from rtcomp.jobs.simulate import on_reference
from rtcomp.kernels import Floats

CYCLE = 1000
"""Samples of a cycle, as in section 3.1."""
INTERVALS, RANGE_M = 20, 1e-4
"""The paper's intervals, all equally wide, and their sum: what the stage's hysteresis reaches over."""
ASYMMETRY, SOFTENING = 0.1, 0.3
"""Size of the flaws of Fig. 11: the text calls them minor and gives no number, so the catalogue's examples of
`asymmetric-friction` and `non-congruent-friction` are taken as they stand:
branches 20 % apart in stiffness, slopes 30 % off at zero force and at the level."""


def rig(asymmetry: float = 0.0, softening: float = 0.0) -> Configuration:
    """Return the shipped Leuven stage without sensor noise, with the flaws in its simulated friction.

    What the loop believes has no flaws, as in the paper. `asymmetry` and `softening` are the parameters of
    the effects `asymmetric-friction` and `non-congruent-friction` (both 1).
    """
    base = Configuration.load(shipped("leuven.yaml"))
    identify = {**base.file.data["identify"], "smoothing": 0.0}
    base = base.changed(sensor={"noise": 0.0, "resolution": 0.0}, identify=identify)
    effects: list[dict[str, Any]] = []
    if asymmetry:
        effects.append({"name": "asymmetric-friction", "asymmetry": asymmetry})
    if softening:
        effects.append({"name": "non-congruent-friction", "softening": softening})
    if not effects:
        return base
    return base.simulating(base.changed(stage={**base.file.data["stage"], "effects": effects}).stage)


def moved(config: Configuration, reference: Floats) -> Friction:
    """Follow `reference` (m, one a tick, from rest at 0) in closed loop; return the friction it showed."""
    return friction(config, on_reference(config, reference, 0.0))


def main_loop(cycles: int, amplitude: float = 7e-5) -> Floats:
    """Return a sine of `amplitude` (m), a cycle in `CYCLE` samples, beginning at rest, (cycles * CYCLE,)."""
    t = np.arange(cycles * CYCLE) / CYCLE
    return np.asarray(amplitude * np.sin(2 * np.pi * t) * np.minimum(1.0, 10.0 * t))


def minor_loops(seed: int, cycles: int) -> Floats:
    """Return cycles of a slow sine with a faster one on it, sizes drawn anew for each, (cycles * CYCLE,), m.

    Each begins and ends at 0. The slow sine is 15 to 45 um, the other, of 4 or 5 to a cycle, 10 to 25 um;
    the axis, held back by its friction, turns back inside presliding.
    """
    chance = np.random.default_rng([seed, 1])
    t = np.arange(CYCLE) / CYCLE
    parts = []
    for _ in range(cycles):
        slow, fast = chance.uniform(1.5e-5, 4.5e-5), chance.uniform(1e-5, 2.5e-5)
        times = int(chance.integers(4, 6))
        parts.append(slow * np.sin(2 * np.pi * t) + fast * np.sin(2 * np.pi * times * t))
    return np.concatenate(parts)


def other_motion(seed: int, cycles: int = 6) -> Floats:
    """Return motion that is not learned from: five sines of 0.3 to 2 to a cycle, 75 um at most, (K,), m."""
    chance = np.random.default_rng([seed, 2])
    t = np.arange(cycles * CYCLE) / CYCLE
    total = np.zeros(t.size)
    for f, phase in zip(np.geomspace(0.3, 2.0, 5), chance.uniform(0, 2 * np.pi, 5), strict=True):
        total += f**-0.5 * np.sin(2 * np.pi * f * t + phase)
    total -= total[0]
    return np.asarray(7.5e-5 * total / np.abs(total).max() * np.minimum(1.0, 5.0 * t))
