"""The null distribution: replicates are judged by columns of their own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from recorded import RATE, STAGE, run, there_and_back

from rtcomp.diagnosis.candidates.effects import on_other
from rtcomp.diagnosis.candidates.screening import look
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage


def test_on_its_own_data_a_candidate_is_itself() -> None:
    balance = ForceBalance(Stage.from_dict(STAGE), load_data([run(Stage.from_dict(STAGE), there_and_back())]))
    base, fitter = baseline(balance), Fitter(balance)
    made = look(fitter, base).candidates
    assert len(made) > 20
    for one in made[::5]:
        again = on_other(one, fitter, base)
        assert again is not None and again.point == one.point
        np.testing.assert_allclose(again.columns, one.columns, rtol=1e-9, atol=1e-12)


def strokes(seconds: float) -> Floats:
    """Moves of 60 mm at up to 150 mm/s, as a machine's axis makes them (m)."""
    t = np.arange(int(seconds * RATE)) / RATE
    return np.asarray(0.03 * np.sin(2 * np.pi * 0.5 * t) + 0.02 * np.sin(2 * np.pi * 0.83 * t))


@pytest.mark.slow
def test_a_drag_shows_behind_a_coarse_encoder_whose_counts_are_loud_in_the_command() -> None:
    """The command chatters by counts that the position hardly shows: columns of the recording see both."""
    screw: dict[str, Any] = {
        "stage": {
            "mass": 28.0, "force_constant": 40.0, "voltage_limit": 19.0, "viscous": 250.0,
            "friction": [{"stiffness": 1.1e7, "reach": 1.5e-6}, {"stiffness": 6e5, "reach": 1e-5}],
        },
        "sensor": {"noise": 0.0, "resolution": 1e-6},
        "controller": {"kp": 4400.0, "ki": 68000.0, "kd": 78.0},
        "rate": RATE,
    }  # fmt: skip
    drag = {"name": "quadratic-drag", "coefficient": 680.0}
    true = Stage.from_dict({**screw, "stage": {**screw["stage"], "effects": [drag]}})
    found = diagnose(Stage.from_dict(screw), [run(true, strokes(20.0))], budget=120.0)
    assert [e.names for e in found.effects] == [("quadratic-drag",)]
    assert found.effects[0].parameters["coefficient"].value == pytest.approx(680.0, rel=0.1)
