"""Recordings of a simulated axis in closed loop, for the tests of what is made of them."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rtcomp.kernels import Floats
from rtcomp.recording.reader import Recording
from rtcomp.stage.simulate import Simulator
from rtcomp.stage.stage import Stage

RATE = 1000.0
STAGE: dict[str, Any] = {
    "stage": {
        "mass": 2.0,
        "force_constant": 4.0,
        "voltage_limit": 10.0,
        "viscous": 8.0,
        "micro_damping": 250.0,
        "friction": [{"stiffness": 2e5, "reach": 4e-6}, {"stiffness": 6e4, "reach": 1.2e-5}],
    },
    "sensor": {"noise": 1.5e-8, "resolution": 1e-8},
    "controller": {"kp": 2e4, "ki": 2e5, "kd": 100.0},
    "rate": RATE,
}


def stage(**changes: Any) -> Stage:
    """The stage, with other values in its section `stage`."""
    return Stage.from_dict({**STAGE, "stage": {**STAGE["stage"], **changes}})


def run(axis: Stage, reference: Floats, seed: int = 1) -> Recording:
    """Follow `reference` (m) under the stage's own controller and record it."""
    simulator, c = Simulator(axis, seed=seed), axis.controller
    assert c is not None
    position, voltage = np.empty(reference.size), np.empty(reference.size)
    total = last = 0.0
    for k, target in enumerate(reference.tolist()):
        position[k] = simulator.measure()
        error = target - position[k]
        total += error / RATE
        wanted = c.kp * error + c.ki * total + c.kd * (error - last) * RATE
        voltage[k] = float(np.clip(wanted, -axis.voltage_limit, axis.voltage_limit))
        last = error
        simulator.advance(voltage[k], 1.0 / RATE)
    columns = {
        "time": np.arange(reference.size) / RATE, "reference": reference, "position": position,
        "voltage": voltage,
    }  # fmt: skip
    return Recording(columns, RATE, {}, Path("run.csv"))


def there_and_back(seconds: float = 6.0) -> Floats:
    """A reference (m) with many reversals."""
    t = np.arange(int(seconds * RATE)) / RATE
    fade = np.clip(t / 0.5, 0.0, 1.0)
    return fade * (3e-4 * np.sin(2 * np.pi * 0.7 * t) + 5e-5 * np.sin(2 * np.pi * 4.1 * t))


def changed(recording: Recording, **columns: Floats) -> Recording:
    """The recording with columns replaced."""
    return replace(recording, columns={**recording.columns, **columns})


def cut(recording: Recording, first: int, last: int) -> Recording:
    """Some of the recording's rows."""
    return replace(recording, columns={k: v[first:last] for k, v in recording.columns.items()})


def of_axis(recording: Recording, axis: str) -> Recording:
    """The recording as our own files have it, of a stage with that axis."""
    return replace(recording, metadata={"stage": json.dumps(stage(axis=axis).to_dict())})


def at_hand(name: str) -> Path:
    """Return a file or folder of what is shared beside the project; skip the test where it is not at hand."""
    shared = Path(os.environ.get("RTCOMP_SHARED", Path(__file__).parents[3] / "shared/data"))
    path = shared / name
    if not path.exists():
        pytest.skip(f"needs {path}; set RTCOMP_SHARED to the folder that holds {name.split('/')[0]}")
    return path
