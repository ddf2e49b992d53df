"""The derivative of a stage's controller is filtered as the recorded command shows it."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from recorded import RATE, run, stage, there_and_back

from rtcomp.control.pid import Derivative, pid_state, pid_step, pid_vector
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.controller import INPUTS, gains
from rtcomp.diagnosis.forces.replicate import left_by
from rtcomp.diagnosis.recordings.data import Segment, load_data
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage


def commanded(axis: Stage, parameters: Floats) -> Segment:
    """What a controller with these parameters commands of a noisy reading."""
    random, target = np.random.default_rng(4), there_and_back(3.0)
    read = target + 2e-6 * np.round(random.standard_normal(target.size))
    state, volts = pid_state(), np.empty(target.size)
    for k in range(target.size):
        volts[k] = pid_step(parameters, state, target[k] - read[k], read[k], 0.0)
    return Segment(np.arange(target.size) / RATE, read, volts, target)


@pytest.mark.parametrize(("of", "filtering"), list(product(INPUTS, (0.0, 0.5, 2.0, 7.3, 16.0))))
def test_the_filter_and_the_input_of_a_derivative_are_found(of: Derivative, filtering: float) -> None:
    axis = stage()
    c = axis.controller
    assert c is not None
    true = pid_vector(
        c.kp, c.ki, c.kd, period=1.0 / RATE, derivative=of, derivative_time=filtering / RATE,
        voltage_limit=axis.voltage_limit,
    )  # fmt: skip
    assert gains(axis, 1.0 / RATE, commanded(axis, true)) == pytest.approx(true, rel=1e-3, abs=1e-3)


def test_without_a_command_the_derivative_is_that_of_our_own_loop() -> None:
    axis = stage()
    c = axis.controller
    assert c is not None
    plain = pid_vector(c.kp, c.ki, c.kd, period=1.0 / RATE, voltage_limit=axis.voltage_limit)
    assert gains(axis, 1.0 / RATE) == pytest.approx(plain)


def test_a_replicate_is_as_loud_as_the_recording() -> None:
    """The recording's loop takes plain differences, of a coarse sensor."""
    axis = Stage.from_dict({**stage().to_dict(), "sensor": {"noise": 1e-7, "resolution": 1e-6}})
    recording = run(axis, there_and_back(8.0))
    balance = ForceBalance(axis, load_data([recording]))
    base = baseline(balance)
    data = left_by(Fitter(balance).stage(base, between=True), balance)
    assert data is not None
    loud = np.std(np.diff(data.segments[0].voltage))
    assert loud == pytest.approx(np.std(np.diff(recording.voltage)), rel=0.05)
