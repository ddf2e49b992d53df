"""The steps of a simulation: how long they are, and what a drive does within one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from moved import drive, stage

from rtcomp.stage.simulate import Simulator, largest_step
from rtcomp.stage.stage import Stage

STOP = [{"stiffness": 1e8, "reach": 2e-8}]


def test_the_step_follows_stiffness_damping_and_rate():
    assert largest_step(stage(1.0)) == 1e-3
    assert largest_step(stage(1.0, STOP)) == pytest.approx(0.03e-4)
    assert largest_step(stage(1.0, viscous=1e4)) == pytest.approx(1e-5)


@pytest.mark.parametrize("metre", [1e-3, 1e3])
def test_the_step_does_not_depend_on_the_unit_of_length(metre):
    """Lengths and forces so many times as large, stiffness and damping the same."""

    def step(unit):
        effects = [
            {"name": "quadratic-drag", "coefficient": 5e5 / unit},
            {"name": "parallel-spring", "stiffness": 1e3, "cubic": 1e9 / unit**2},
        ]
        m = {"mass": 2.0, "force_constant": 4.0 * unit, "voltage_limit": 10.0, "viscous": 20.0}
        made = Stage.from_dict({"stage": {**m, "effects": effects}, "rate": 10.0})
        return largest_step(made, 1e-2 * unit)

    assert step(metre) == pytest.approx(step(1.0), rel=1e-9)


@settings(max_examples=40, deadline=None)
@given(delay=st.floats(1e-5, 9e-3), substeps=st.integers(1, 5))
@example(delay=1.5e-3, substeps=2)  # a change where a step ends
def test_a_late_command_gives_its_impulse_whenever_it_changes(delay, substeps):
    axis = stage(mass=2.0, effects=[{"name": "drive-delay", "delay": delay}])
    volts = np.random.default_rng(3).uniform(-5.0, 5.0, 40)
    found = drive(Simulator(axis, substeps=substeps), volts, 1e-3)
    edges = 1e-3 * np.arange(volts.size + 1)
    impulse = np.concatenate([[0.0], np.cumsum(4.0 * volts) * 1e-3])
    late = np.interp(edges[1:] - delay, edges, impulse)
    np.testing.assert_allclose(found[:, 1], late / 2.0, atol=1e-12)
    time = np.linspace(0.0, edges[-1], 400_001)
    speed = np.interp(time - delay, edges, impulse) / 2.0
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * (time[1] - time[0])])
    step = 1e-3 / substeps
    assert np.abs(found[:, 0] - np.interp(edges[1:], time, way)).max() < 4.0 * 5.0 / 2.0 * step**2 * 40


@settings(max_examples=40, deadline=None)
@given(constant=st.floats(1e-6, 0.1), substeps=st.integers(1, 5))
def test_a_lagged_command_gives_its_impulse_however_short_the_lag(constant, substeps):
    axis = stage(mass=2.0, effects=[{"name": "drive-lag", "time_constant": constant}])
    volts = np.random.default_rng(3).uniform(-5.0, 5.0, 40)
    found = drive(Simulator(axis, substeps=substeps), volts, 1e-3)
    lagged = speed = 0.0
    for u, reached in zip(volts.tolist(), found[:, 1].tolist(), strict=True):
        speed += 4.0 / 2.0 * (1e-3 * u + (lagged - u) * -np.expm1(-1e-3 / constant) * constant)
        lagged = u + (lagged - u) * np.exp(-1e-3 / constant)
        assert reached == pytest.approx(speed, abs=1e-12)


@pytest.mark.parametrize(
    "drive_of", [{"name": "drive-delay", "delay": 1e-12}, {"name": "back-emf", "coefficient": 1e-9}]
)
def test_magnets_pull_once_however_the_drive_changes_within_a_step(drive_of):
    wave = {"name": "cogging", "amplitude": 2.0, "period": 4e-4, "phase": 0.5}
    volts = np.random.default_rng(5).uniform(-1.0, 1.0, 200)
    with_it, without = (
        drive(Simulator(stage(mass=2.0, effects=[*more, wave])), volts, 1e-3) for more in ([drive_of], [])
    )
    assert np.abs(without[:, 1]).max() > 0.01
    np.testing.assert_allclose(with_it[:, 1], without[:, 1], rtol=0.0, atol=5e-4)


def test_a_command_beyond_the_limit_of_the_drive_does_no_more():
    limited = Stage.from_dict({"stage": {"mass": 1.0, "force_constant": 4.0, "voltage_limit": 2.0}})
    at, beyond = Simulator(limited), Simulator(limited)
    drive(at, np.full(10, 2.0), 1e-3)
    drive(beyond, np.full(10, 50.0), 1e-3)
    assert beyond.position == at.position > 0
