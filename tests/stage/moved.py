"""A stage and its motion under commands, for the tests of its simulation."""

from __future__ import annotations

import numpy as np

from rtcomp.stage.stage import Stage


def stage(mass=1.0, friction=None, effects=(), rate=1000.0, sensor=None, **more):
    mechanics = {
        "mass": mass,
        "force_constant": 4.0,
        "voltage_limit": 100.0,
        "effects": list(effects),
        **more,
    }
    if friction is not None:
        mechanics["friction"] = friction
    return Stage.from_dict({"stage": mechanics, "rate": rate, **({"sensor": sensor} if sensor else {})})


def drive(simulator, volts, period):
    """Positions, velocities and friction after each period of the commands."""
    out = np.empty((len(volts), 3))
    for k, u in enumerate(volts):
        simulator.advance(float(u), period)
        out[k] = simulator.position, simulator.velocity, simulator.friction
    return out
