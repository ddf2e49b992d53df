"""A run on an axis with a past: relaxed, let go, and followed with its memory known."""

from __future__ import annotations

import numpy as np
import pytest
from rtcomp_drivers.plant_process import PlantProcess

from rtcomp.jobs.follow import follow

SMALL = {"kind": "triangle", "amplitude": 1.2e-5, "frequency": 1.0, "corner": 0.2, "duration": 3.0}
"""Far less than it takes to wipe out what friction remembers."""
RUNS = 3
"""Tries: a machine that stops either process while the axis relaxes gives it another past."""


def test_an_asymmetric_axis_is_followed_from_where_relaxing_left_it(leuven, tmp_path):
    """Reversals that die out load its contacts to one side: no virgin state, but a known one."""
    effect = {"name": "asymmetric-friction", "asymmetry": 0.3}
    plant = leuven.stage.with_changes(stage={"effects": [effect]})
    plant.save(tmp_path / "plant.yaml")
    off = []
    while not off or (off[-1] > 1.2e-7 and len(off) < RUNS):
        with PlantProcess(tmp_path / "plant.yaml") as process:
            config = leuven.changed(
                device={"driver": "serial", "port": process.port}, compensate={"reference": SMALL}
            )
            path = tmp_path / f"run{len(off)}.h5"
            run = follow(config, "compensate", stage=plant, feedforward_from=0.0, path=path)
        c = run.columns
        assert c["reference"][0] != 0.0 and abs(c["position"][:20] - c["reference"][0]).max() < 2e-6
        assert abs(c["feedforward"][0]) < 0.2, "let go, it holds no force: at once it was 0.5 V"
        off.append(float(np.median(np.abs(c["position"] - c["reference"])[500:])))
    # 0.03 um; as if virgin, or let go at once, 0.2 to 0.7.
    assert off[-1] < 1.2e-7, off


def test_without_a_past_there_is_no_relaxing(leuven):
    run = follow(leuven, "compensate", stage=leuven.stage, feedforward_from=0.0)
    assert run.columns["reference"][0] == pytest.approx(leuven.reference("compensate").evaluate(0.0)[0])
    assert run.columns["device_time"][0] < 2e-3
