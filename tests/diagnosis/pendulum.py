"""A pendulum on a geared servo, whose encoder does not see its friction yield."""

from __future__ import annotations

from typing import Any

import numpy as np

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.recording.reader import Recording
from rtcomp.stage.simulate import Simulator
from rtcomp.stage.stage import Stage

RATE = 200.0
COUNT = 1.5e-3
BELIEF: dict[str, Any] = {
    "stage": {
        "axis": "rotary",
        "mass": 7.0e-3,
        "force_constant": 8.0e-4,
        "voltage_limit": 885.0,
        "viscous": 0.03,
        "friction": [{"stiffness": 40.0, "reach": 1.0e-3}],
        "effects": [{"name": "gravity", "amplitude": -0.48}],
    },
    "sensor": {"resolution": COUNT},
    "rate": RATE,
}
LOAD = {"name": "load-dependent-friction", "coefficient": 0.25}


def stage(*effects: dict[str, Any], **changes: Any) -> Stage:
    """The pendulum with further effects and other values."""
    section = {**BELIEF["stage"], **changes}
    return Stage.from_dict({**BELIEF, "stage": {**section, "effects": [*section["effects"], *effects]}})


def recorded(axis: Stage, seconds: float = 12.0, gain: float = 500.0, pace: float = 1.0) -> Recording:
    """The pendulum under a proportional controller that a slow and a fast wave lead."""
    time = np.arange(round(seconds * RATE)) / RATE
    reference = 1.5 * np.sin(pace * time) + 0.5 * np.sin(4.3 * pace * time) * np.sin(2.0 * pace * time)
    simulator = Simulator(axis)
    position, voltage = np.empty_like(time), np.empty_like(time)
    for k in range(time.size):
        position[k] = simulator.measure()
        voltage[k] = np.clip(gain * (reference[k] - position[k]), -885.0, 885.0)
        simulator.advance(float(voltage[k]), 1.0 / RATE)
    columns = {"time": time, "reference": reference, "position": position, "voltage": voltage}
    return Recording(columns, RATE)


def both(plant: Stage) -> list[Recording]:
    """Two recordings, at two gains and paces."""
    return [recorded(plant), recorded(plant, gain=300.0, pace=1.4)]


def balanced(believed: Stage, data: list[Recording]) -> ForceBalance:
    """The force balance on whose blocks windows are cut."""
    balance = ForceBalance(believed, load_data(data))
    baseline(balance)
    return balance
