"""The load behind a play, from the motion that drives it."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import STAGE, run, stage, there_and_back

from rtcomp.diagnosis.base import fit_base
from rtcomp.diagnosis.motion import prepare
from rtcomp.diagnosis.path import Load, behind_play
from rtcomp.physics import build
from rtcomp.stage.balance import force_balance
from rtcomp.stage.stage import Stage

PLAY = {"name": "backlash", "gap": 4e-6, "share": 0.35, "contact": 90.0}
LOAD = Load(0.8, 20.0, 80.0, 5e-3, np.array([2e5, 6e4]), np.array([4e-6, 1.2e-5]))
LEVEL = 2e5 * 4e-6 + 6e4 * 1.2e-5


def test_a_slow_load_lags_by_the_gap_and_what_its_contact_gives_way() -> None:
    x = np.concatenate([np.linspace(0.0, 2e-4, 4000), np.linspace(2e-4, 0.0, 4000)])
    y = behind_play(x, 1e-3, 4e-6, 90.0, LOAD)
    deflected = (LEVEL + LOAD.viscous * 2e-4 / 4.0) / (LOAD.mass * (2 * np.pi * 90.0) ** 2)
    assert x[3900] - y[3900] == pytest.approx(4e-6 + deflected, rel=0.03)
    assert y[7900] - x[7900] == pytest.approx(4e-6 + deflected, rel=0.03)
    # Friction gives back what it stored, then the load waits until the other end arrives.
    gone = 2e-4 - x[4000:] - deflected
    waiting = (gone > 6e-6) & (gone < 1e-5)
    assert np.ptp(y[4000:][waiting]) < 0.3e-6


def test_without_a_gap_and_on_a_stiff_contact_the_load_goes_along() -> None:
    t = np.arange(3000) / 1000.0
    x = 1e-4 * np.sin(2 * np.pi * 0.8 * t)
    y = behind_play(x, 1e-3, 0.0, 2000.0, LOAD)
    assert np.abs(x - y).max() < 2e-7


def test_the_balance_holds_with_the_contact_that_is_there_and_with_no_other() -> None:
    """Both forms of it, that of the diagnosis and that of the stage, on a simulated play."""
    axis = Stage.from_dict({**STAGE, "stage": {**STAGE["stage"], "effects": [PLAY]}})
    recording = run(axis, there_and_back(12.0))
    motion = prepare(stage(), [recording])
    left = {
        what: float(fit_base(stage(), motion, effects=[build(e)]).errors.sum())
        for what, e in {"true": PLAY, "other": {**PLAY, "contact": 300.0, "share": 0.6}}.items()
    }
    assert left["true"] < 0.1 * left["other"]
    error = {
        what: force_balance(s, recording.time, recording.position, recording.voltage, 40.0).relative_error
        for what, s in {"true": axis, "none": stage()}.items()
    }
    assert error["true"] < 0.25 * error["none"]
