"""The load behind a play, from the motion that drives it."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import STAGE, run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.play import Load, behind_play
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.stage.balance import force_balance, zero_phase
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


def test_both_forms_of_a_play_converge_to_one() -> None:
    """The load's force in whole rows: by the stage's kernel, and by its equation of motion in the diagnosis.

    First-order errors of either would be per cents here: the load's speed is a sawtooth from kick to kick.
    """
    t = np.arange(4000) / 1000.0
    x = 5e-5 * np.sin(2 * np.pi * 1.5 * t) + 2e-5 * np.sin(2 * np.pi * 4.0 * t)
    mechanics = {
        "mass": 2.0, "force_constant": 4.0, "voltage_limit": 10.0, "viscous": LOAD.viscous,
        "micro_damping": LOAD.micro_damping, "micro_damping_speed": LOAD.micro_speed,
        "friction": [{"stiffness": 2e5, "reach": 4e-6}, {"stiffness": 6e4, "reach": 1.2e-5}],
        "effects": [{"name": "backlash", "gap": 1e-7, "share": 0.4, "contact": 90.0}],
    }  # fmt: skip
    with_play = Stage.from_dict({"stage": mechanics, "rate": 1000.0})
    without = Stage.from_dict({"stage": {**mechanics, "effects": []}, "rate": 1000.0})
    y = behind_play(x, 1e-3, 1e-7, 90.0, LOAD)
    none = np.zeros_like(t)
    by_kernel = force_balance(with_play, t, x, none, 40.0).force_motion
    of_the_load = force_balance(without, t, y, none, 40.0).force_motion
    behind = np.zeros_like(t)
    behind[1:-1] = np.diff(y - x, 2) / 1e-6
    needed = of_the_load - 1.2 * zero_phase(behind, 40.0, 1000.0)
    inner = slice(500, -100)
    off = np.sqrt(np.mean((by_kernel - needed)[inner] ** 2) / np.mean(needed[inner] ** 2))
    assert off < 2e-3


def test_the_balance_holds_with_the_contact_that_is_there_and_with_no_other() -> None:
    """Both forms of it, that of the diagnosis and that of the stage, on a simulated play."""
    axis = Stage.from_dict({**STAGE, "stage": {**STAGE["stage"], "effects": [PLAY]}})
    recording = run(axis, there_and_back(12.0))
    balance = ForceBalance(stage(), load_data([recording]))
    baseline(balance)
    fitter = Fitter(balance)
    left = {
        what: fitter.fit([Term(e, frozenset())], steps=0).sse
        for what, e in {"true": PLAY, "other": {**PLAY, "contact": 300.0, "share": 0.6}}.items()
    }
    assert left["true"] < 0.1 * left["other"]
    error = {
        what: force_balance(s, recording.time, recording.position, recording.voltage, 40.0).relative_error
        for what, s in {"true": axis, "none": stage()}.items()
    }
    assert error["true"] < 0.25 * error["none"]
