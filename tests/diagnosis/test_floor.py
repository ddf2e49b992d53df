"""The floor: with a controller and without one, it is what noise leaves where all is right."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from recorded import STAGE, run
from test_alike import reference

from rtcomp.diagnosis.base import fit_base
from rtcomp.diagnosis.floor import floor_errors
from rtcomp.diagnosis.motion import prepare
from rtcomp.stage.stage import Stage


@pytest.mark.parametrize("controlled", [True, False])
@pytest.mark.parametrize(("noise", "averaged"), [(1.5e-8, 1), (1e-7, 2)])
def test_the_floor_is_what_noise_leaves(controlled: bool, noise: float, averaged: int) -> None:
    """Also where rows are averaged, and their noise with them."""
    data: dict[str, Any] = {**STAGE, "sensor": {"noise": noise, "resolution": 1e-8}}
    axis = Stage.from_dict(data)
    recording = run(axis, reference())
    if not controlled:
        axis = Stage.from_dict({k: v for k, v in data.items() if k != "controller"})
    motion = prepare(axis, [recording])
    assert motion.averaged == averaged
    fitted = fit_base(axis, motion)
    floor = floor_errors(axis, fitted, motion)
    assert floor.shape == fitted.errors.shape
    assert 0.6 < float(fitted.errors.sum() / floor.sum()) < 1.5


def test_without_noise_the_method_alone_is_left() -> None:
    data: dict[str, Any] = {**STAGE, "sensor": {"noise": 0.0, "resolution": 0.0}}
    axis = Stage.from_dict({k: v for k, v in data.items() if k != "controller"})
    motion = prepare(axis, [run(Stage.from_dict(data), reference())])
    fitted = fit_base(axis, motion)
    power = fitted.system.blocks.power[fitted.ledger.seen].sum()
    floor = floor_errors(axis, fitted, motion)
    assert np.sqrt(floor.sum() / power) == pytest.approx(0.0015, rel=0.5)


@pytest.mark.parametrize(
    "effect",
    [
        {"name": "cogging", "amplitude": 0.4, "period": 1.3e-4, "phase": 0.4},  # of the drive
        {"name": "stribeck", "rise": 0.3, "velocity": 5e-3},  # of friction
        {"name": "parallel-spring", "stiffness": 2000.0},
    ],
    ids=lambda e: e["name"],
)
def test_what_the_stage_is_believed_to_have_counts_once(effect: dict[str, Any]) -> None:
    axis = Stage.from_dict({**STAGE, "stage": {**STAGE["stage"], "effects": [effect]}})
    motion = prepare(axis, [run(axis, reference())])
    fitted = fit_base(axis, motion)
    assert 0.5 < float(fitted.errors.sum() / floor_errors(axis, fitted, motion).sum()) < 2.0
