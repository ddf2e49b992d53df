"""The next experiment: the manoeuvre in which two stages differ most, run as the loop itself would run it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rtcomp.diagnosis.forces.replicate import followed
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.simulate import on_reference
from rtcomp.stage.stage import Stage
from rtcomp.yamlfile import YamlFile

RATE = 1000.0


def stage(**changes: float) -> Stage:
    """A stage with a controller and friction, and a sensor without noise."""
    return Stage.from_dict(
        {
            "stage": {
                "mass": 2.0, "force_constant": 5.0, "voltage_limit": 10.0, "viscous": 3.0,
                "friction": [{"stiffness": 2.0e5, "reach": 5.0e-6}], **changes,
            },
            "sensor": {"resolution": 1e-8},
            "controller": {"kp": 2.0e3, "ki": 1.0e4, "kd": 20.0},
            "rate": RATE,
        }
    )  # fmt: skip


def test_a_path_is_followed_as_the_loop_follows_it() -> None:
    t = np.arange(4000) / RATE
    path = 2e-3 * np.sin(2.0 * np.pi * 0.7 * t) + 2e-4 * np.sin(2.0 * np.pi * 9.0 * t)
    one, heavier = stage(), stage(mass=2.2)
    position, voltage = followed(one, path, RATE)
    run = on_reference(Configuration.of(YamlFile(one.to_dict(), Path("stage"))), path, float(path[0]))
    other = followed(heavier, path, RATE)
    for mine, loop, apart in zip(
        (position, voltage), (run.columns["position"], run.columns["voltage"]), other, strict=True
    ):
        assert np.std(mine - loop) < 0.1 * np.std(apart - mine)
        assert mine == pytest.approx(loop, abs=0.03 * float(np.ptp(loop)))
