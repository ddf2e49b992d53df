"""Short simulations from points of a recorded motion."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp.errors import ConfigError
from rtcomp.stage.shoot import shoot
from rtcomp.stage.simulate import Simulator, largest_step, largest_stiffness
from rtcomp.stage.stage import Stage

PERIOD = 2e-3
PENDULUM = Stage.from_dict(
    {
        "stage": {
            "axis": "rotary",
            "mass": 6.5e-3,
            "force_constant": 1e-3,
            "voltage_limit": 900.0,
            "viscous": 0.03,
            "friction": [{"stiffness": 20.0, "reach": 2e-3}, {"stiffness": 4.0, "reach": 8e-3}],
            "effects": [
                {"name": "gravity", "amplitude": -0.48},
                {"name": "load-dependent-friction", "coefficient": 0.2},
                {"name": "drive-lag", "time_constant": 0.02},
            ],
        }
    }
)


def simulated(stage: Stage, rows: int = 1500) -> tuple[np.ndarray, ...]:
    """Return time, position, velocity and voltage of a motion with rests, row by row."""
    time = np.arange(rows) * PERIOD
    voltage = 350.0 * np.clip(3.0 * np.sin(2.5 * time), -1.0, 1.0) + 40.0 * np.sin(9.0 * time)
    simulator = Simulator(stage)
    position, velocity = np.empty(rows), np.empty(rows)
    for k in range(rows):
        position[k], velocity[k] = simulator.position, simulator.velocity
        simulator.advance(float(voltage[k]), PERIOD)
    return time, position, velocity, voltage


def test_let_go_anywhere_it_goes_on_as_it_did():
    time, position, velocity, voltage = simulated(PENDULUM)
    starts = np.arange(0, 1300, 90)
    found = shoot(PENDULUM, time, position, velocity, voltage, starts, 150)
    truth = np.array([position[s : s + 150] for s in starts])
    assert np.ptp(truth, axis=1).max() > 0.3
    assert np.abs(found - truth).max() < 2e-3


def test_a_load_behind_a_play_is_where_it_was():
    """Its contact rings faster than rows follow one another: it is led there in finer steps."""
    play = {"name": "backlash", "gap": 0.02, "share": 0.5, "contact": 80.0}
    loose = PENDULUM.with_changes(stage={"viscous": 0.2, "effects": [play]})
    time, position, velocity, voltage = simulated(loose)
    starts = np.arange(0, 1300, 30)
    found = shoot(loose, time, position, velocity, voltage, starts, 20)
    truth = np.array([position[s : s + 20] for s in starts])
    moved = np.abs(truth - truth[:, :1])
    assert np.abs(found - truth).mean() < 0.03 * moved.mean()


def test_the_friction_remembers_what_was_before_the_start():
    # Let go where it turns: without its memory friction would be nothing there, and the lag empty.
    time, position, velocity, voltage = simulated(PENDULUM)
    turns = np.flatnonzero(np.diff(np.sign(velocity)) != 0)[3:-3]
    assert turns.size >= 10
    led = shoot(PENDULUM, time, position, velocity, voltage, turns, 20)
    truth = np.array([position[s : s + 20] for s in turns])
    forgot = np.array(
        [
            shoot(PENDULUM, *(c[s:] for c in (time, position, velocity, voltage)), np.array([0]), 20)[0]
            for s in turns
        ]
    )
    assert np.median(np.abs(led - truth)) < 0.2 * np.median(np.abs(forgot - truth))


def test_wrong_friction_moves_off():
    time, position, velocity, voltage = simulated(PENDULUM)
    starts = np.arange(0, 1300, 90)
    wrong = PENDULUM.with_changes(stage={"effects": PENDULUM.mechanics.effects[:1]})
    right = shoot(PENDULUM, time, position, velocity, voltage, starts, 150)
    off = shoot(wrong, time, position, velocity, voltage, starts, 150)
    truth = np.array([position[s : s + 150] for s in starts])
    assert np.abs(off - truth).mean() > 20 * np.abs(right - truth).mean()


@pytest.mark.parametrize(("start", "rows"), [(1490, 20), (-1, 5), (0, 0)])
def test_windows_outside_the_recording_are_refused(start, rows):
    time = np.arange(1500) * PERIOD
    with pytest.raises(ValueError, match="do not lie within"):
        shoot(PENDULUM, time, time, time, time, np.array([start]), rows)


def test_what_no_row_tells_of_is_not_simulated() -> None:
    """So much damping on so little mass asks for a million steps a row: that would end after hours."""
    time, position, velocity, voltage = simulated(PENDULUM)
    quick = PENDULUM.with_changes(stage={"mass": 6.5e-6, "viscous": 3e2})
    with pytest.raises(ConfigError, match="cannot be simulated in reasonable time: 1 windows of 100 rows"):
        shoot(quick, time, position, velocity, voltage, np.array([200]), 100)


@pytest.mark.parametrize("size", [2e-4, 3e-3])
def test_a_spring_that_stiffens_is_as_stiff_as_the_motion_makes_it(size: float) -> None:
    """Steps follow the slope where the axis goes: as exact, and no more of them than that needs."""
    cubic = {"name": "parallel-spring", "stiffness": 200.0, "cubic": 1e3 / size**2}
    stage = Stage.from_dict(
        {
            "stage": {
                "mass": 0.5,
                "force_constant": 2.0,
                "voltage_limit": 9.0,
                "viscous": 4.0,
                "effects": [cubic],
            }
        }
    )
    rows, row = 2000, 1e-3
    time = np.arange(rows) * row
    voltage = 600.0 * size * np.sin(30.0 * time) * np.sin(4.0 * time)
    simulator = Simulator(stage, substeps=4)
    position, velocity = np.empty(rows), np.empty(rows)
    for k in range(rows):
        position[k], velocity[k] = simulator.position, simulator.velocity
        simulator.advance(float(voltage[k]), row)
    far = float(np.abs(position).max())
    assert 0.1 * size < far < 3.0 * size
    starts = np.arange(0, 1800, 150)
    found = shoot(stage, time, position, velocity, voltage, starts, 150)
    truth = np.array([position[s : s + 150] for s in starts])
    assert np.abs(found - truth).max() < 0.01 * far
    assert largest_step(stage, 2.0 * far) >= largest_step(stage)
    assert largest_stiffness(stage, far) == pytest.approx(200.0 + 3.0 * cubic["cubic"] * far**2)
