"""Axes on springs with friction, driven in open loop: a multisine, a chirp or steps of the command."""

from __future__ import annotations

import math

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.trial.axis import Loop, Physics
from rtcomp.trial.families.family import Family, Motion, believed_springs, log_uniform


def draw_stage(chance: np.random.Generator) -> tuple[Loop, Physics, Motion]:
    """Draw an axis on a spring and how it is to be driven; there is no controller."""
    rate = float(chance.choice([1000.0, 2000.0, 4000.0]))
    mass, stroke = log_uniform(chance, 0.3, 3.0), log_uniform(chance, 1e-4, 1e-3)
    own = 2.0 * math.pi * log_uniform(chance, 5.0, 25.0)
    spring = mass * own**2
    edge = spring * stroke
    volts = chance.uniform(2.0, 5.0)
    level = edge * chance.uniform(0.03, 0.15)
    shape, reach = chance.uniform(2.5, 5.0), stroke / chance.uniform(15.0, 40.0)
    physics = Physics(
        mass, edge / volts, 10.0, 2.0 * chance.uniform(0.05, 0.2) * mass * own, 0.0, 0.1 * stroke * own,
        level, reach, shape, spring=spring,
    )  # fmt: skip
    resolution, noise = float(chance.choice([1e-9, 1e-8])), log_uniform(chance, 5e-9, 2e-8)
    motion = {
        "seconds": chance.uniform(20.0, 40.0), "volts": volts, "own": own / (2.0 * math.pi),
        "kind": float(chance.integers(0, 3)),
    }  # fmt: skip
    return Loop(0.0, 0.0, 0.0, rate, noise, resolution, 1.0), physics, motion


def command(chance: np.random.Generator, loop: Loop, motion: Motion) -> Floats:
    """Return the command (V, (K,)): 0 a multisine, 1 chirps up and down, 2 steps; from zero to zero."""
    count, own = round(motion["seconds"] * loop.rate), motion["own"]
    time = np.arange(count) / loop.rate
    low, high = 0.05 * own, min(3.0 * own, 0.1 * loop.rate)
    if motion["kind"] == 0.0:
        frequencies = np.exp(chance.uniform(math.log(low), math.log(high), 24))
        wave = np.sin(2.0 * np.pi * np.outer(time, frequencies) + chance.uniform(0.0, 6.28, 24))
        raw = wave @ np.minimum(1.0, own / frequencies) ** 0.5
        raw /= np.max(np.abs(raw))
    elif motion["kind"] == 1.0:
        sweeps, phase = 3, chance.uniform(0.0, 6.28)
        part = (time / time[-1] * sweeps) % 2.0
        frequency = low * (high / low) ** np.where(part < 1.0, part, 2.0 - part)
        raw = np.sin(phase + 2.0 * np.pi * np.cumsum(frequency) / loop.rate)
        raw *= np.where(np.arange(count) < count // 2, 1.0, chance.uniform(0.3, 0.8))
    else:
        raw, k = np.zeros(count), 0
        while k < count:
            long = max(2, round(log_uniform(chance, 0.3, 6.0) / own * loop.rate))
            raw[k : k + long] = chance.uniform(-1.0, 1.0)
            k += long
    edge = np.clip(np.minimum(time, time[-1] - time) / 0.3, 0.0, 1.0)
    return np.asarray(motion["volts"] * chance.uniform(0.8, 1.0) * raw * np.sin(0.5 * np.pi * edge) ** 2)


FAMILY = Family(
    "open-loop", "axis on a spring driven by a multisine, a chirp or steps", draw_stage, command,
    believed_springs,
    # Beside a spring another scale of the sensor is another gain and another reach.
    lacks=frozenset({"sensor-scale"}),
)  # fmt: skip
