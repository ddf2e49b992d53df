"""Drive, mechanics, disturbances and sensor: each effect's own law, and the order in the chain."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError
from rtcomp.physics import Effect, Parameter, Place, build, entries
from rtcomp.physics.drive import FORCE_ORDER, DriveForce
from rtcomp.physics.rows import motion_rows, new_rows, over_rows
from rtcomp.physics.wires import (
    COUNT,
    DRIVE,
    FRICTION,
    GAIN,
    MASS,
    NOISE,
    POSITION,
    PUSH,
    REACH,
    SENSED,
    STEP,
    TIME,
    VELOCITY,
    VOLTS,
)  # fmt: skip


def one(name, wire, rows=None, parameters=None, **wires):
    """Run one effect on one row and return the wire."""
    rows = new_rows(1) if rows is None else rows
    for key, value in wires.items():
        rows[:, {"x": POSITION, "v": VELOCITY, "u": VOLTS, "t": TIME, "y": SENSED, "noise": NOISE}[key]] = (
            value
        )
    return over_rows([build({"name": name, **(parameters or {})})], rows)[0, wire]


VOLT = st.floats(-20, 20)


@settings(deadline=None)
@given(u=VOLT, width=st.floats(0, 5))
def test_deadband_is_odd_continuous_and_shifted(u, width):
    out = one("drive-deadband", VOLTS, parameters={"width": width}, u=u)
    assert out == pytest.approx(math.copysign(max(abs(u) - width, 0), u))


@settings(deadline=None)
@given(u=VOLT)
def test_saturation_and_offset(u):
    assert one("drive-saturation", VOLTS, parameters={"limit": 5.0}, u=u) == min(max(u, -5.0), 5.0)
    assert one("drive-offset", VOLTS, parameters={"offset": 0.25}, u=u) == u + 0.25


@settings(deadline=None)
@given(pieces=st.integers(1, 50), constant=st.floats(1e-5, 1.0))
def test_lag_is_exact_for_a_held_voltage_however_the_step_is_split(pieces, constant):
    """Its mean over the steps, and at a step of no length what it has come to."""
    rows = new_rows(pieces + 1)
    rows[:, STEP], rows[:, VOLTS] = 0.01 / pieces, 6.0
    rows[-1, STEP] = 0.0
    out = over_rows([build({"name": "drive-lag", "time_constant": constant})], rows)[:, VOLTS]
    part = -math.expm1(-0.01 / constant)
    assert out[-1] == pytest.approx(6.0 * part, rel=1e-9)
    assert out[:-1].mean() == pytest.approx(6.0 * (1.0 - constant / 0.01 * part), rel=1e-6)


def test_gain_ripple_and_back_emf_around_the_force():
    drive = [
        {"name": "drive-gain", "gain": 1.5},
        {"name": "torque-ripple", "amplitude": 0.2, "period": 4e-3, "phase": 0.0},
        {"name": "back-emf", "coefficient": 3.0},
    ]
    chain = sorted([DriveForce(), *map(build, drive)], key=lambda e: e.order)
    rows = new_rows(1)
    rows[0, [VOLTS, GAIN, POSITION, VELOCITY]] = 2.0, 4.0, 1e-3, 0.1
    assert over_rows(chain, rows)[0, DRIVE] == pytest.approx(2.0 * 4.0 * 1.5 * 1.2 - 3.0 * 0.1)


def test_cogging_with_harmonics_is_its_series():
    x, phase = 1.3e-4, 0.4
    harmonics = [{"order": 2, "amplitude": 0.3, "phase": 1.0}, {"order": 6, "amplitude": 0.1}]
    text = {"amplitude": 1.2, "period": 5e-4, "phase": phase, "harmonics": harmonics}
    angle = 2 * math.pi * x / 5e-4
    expected = 1.2 * math.sin(angle + phase) + 0.3 * math.sin(2 * angle + 1.0) + 0.1 * math.sin(6 * angle)
    assert one("cogging", PUSH, parameters=text, x=x) == pytest.approx(expected)
    effect = build({"name": "cogging", **text})
    assert build(effect.to_dict()) == effect
    assert "harmonics" not in build({"name": "cogging", "amplitude": 1.0, "period": 1.0}).to_dict()
    with pytest.raises(ConfigError, match=r"harmonics\[1\]: order is 0"):
        build({"name": "cogging", **text, "harmonics": [*harmonics[:1], {"order": 0, "amplitude": 1}]})
    with pytest.raises(ConfigError, match="'elements'; its list is 'harmonics'"):
        build({"name": "cogging", "amplitude": 1.0, "period": 1.0, "elements": []})


@pytest.mark.parametrize(
    ("position", "x", "depth"),
    [
        (1e-3, 1.2e-3, 2e-4),
        (1e-3, -5.0, 0.0),
        (-1e-3, -1.5e-3, -5e-4),
        (-1e-3, 5.0, 0.0),
        (0.0, 1e-4, 1e-4),
        (0.0, -1e-4, 0.0),
    ],
)
def test_end_stop_pushes_back_from_its_own_side_only(position, x, depth):
    parameters = {"position": position, "stiffness": 1e5}
    assert one("end-stop", PUSH, parameters=parameters, x=x) == pytest.approx(-1e5 * depth)


def test_mechanics_and_disturbances():
    assert one("inertia", MASS, parameters={"mass": 2.5}) == 2.5
    assert one(
        "parallel-spring", PUSH, parameters={"stiffness": 10.0, "cubic": 100.0}, x=-0.2
    ) == pytest.approx(2.8)
    assert one("gravity", PUSH, parameters={"force": -3.0}, x=7.0) == -3.0
    turning = {"amplitude": 2.0, "phase": 0.5}
    assert one("gravity", PUSH, parameters=turning, x=1.0) == pytest.approx(2.0 * math.sin(1.5))
    with pytest.raises(ConfigError, match="gravity: give its force"):
        build({"name": "gravity"})
    tone = {"amplitude": 2.0, "frequency": 50.0}
    assert one("tonal-disturbance", PUSH, parameters=tone, t=0.005) == pytest.approx(2.0)
    assert one("constant-force", PUSH, parameters={"force": 1.5}) == 1.5
    assert one("quadratic-drag", FRICTION, parameters={"coefficient": 2.0}, v=-3.0) == -18.0


def test_position_dependent_friction_never_drives():
    parameters = {"amplitude": 0.5, "period": 1.0, "phase": 0.0, "slope": 10.0}
    assert one("position-dependent-friction", REACH, parameters=parameters, x=0.25) == pytest.approx(4.0)
    assert 0.0 < one("position-dependent-friction", REACH, parameters=parameters, x=-1.0) < 0.01


@settings(deadline=None)
@given(x=st.floats(-1e-3, 1e-3), resolution=st.floats(1e-9, 1e-5))
def test_resolution_rounds_to_the_nearest_count(x, resolution):
    y = one("sensor-resolution", SENSED, parameters={"resolution": resolution}, y=x)
    assert abs(y - x) <= resolution / 2 * (1 + 1e-6)
    assert y / resolution == pytest.approx(round(y / resolution), abs=1e-6)


def test_sensor_scale_is_true_over_believed_length():
    assert one("sensor-scale", SENSED, parameters={"scale": 1.02}, y=1.02) == pytest.approx(1.0)
    assert one("sensor-noise", SENSED, parameters={"rms": 2.0}, y=1.0, noise=-1.5) == -2.0


@settings(deadline=None)
@given(reading=st.floats(-1e-3, 1e-3), share=st.floats(-0.95, 0.95))
def test_periodic_error_is_undone_as_long_as_readings_are_unique(reading, share):
    effect = build(
        {"name": "sensor-periodic-error", "period": 2e-4, "amplitude": share * 2e-4 / (2 * math.pi)}
    )
    w = new_rows(1)[0]
    w[SENSED] = reading
    effect.inverse(effect.vector(), effect.initial_state(), w)
    effect.kernel(effect.vector(), effect.initial_state(), w)
    assert w[SENSED] == pytest.approx(reading, abs=1e-9)


def test_voltage_comes_before_force_in_the_drive():
    """Orders of drive.py: what has an inverse or works on volts or gain runs before drive-force."""
    rows = new_rows(1)
    for entry in entries():
        if entry.place is Place.DRIVE:
            rows[:] = new_rows(1)
            rows[0, [VOLTS, VELOCITY, POSITION, STEP]] = 9.0, 0.01, 1e-4, 1e-3
            before = rows.copy()
            over_rows([entry.from_dict(entry.example)], rows)
            on_voltage = bool(np.any(rows[0, [VOLTS, GAIN]] != before[0, [VOLTS, GAIN]]))
            assert on_voltage == (entry.order < FORCE_ORDER), entry.name


def test_rows_are_checked():
    with pytest.raises(TypeError, match=rf"shape \(n, {COUNT}\)"):
        over_rows([], np.zeros((3, COUNT + 1)))
    with pytest.raises(TypeError):
        over_rows([], np.zeros((3, COUNT), dtype=np.float32))


def test_motion_rows_add_up():
    x = np.array([1.0, 3.0, 2.0])
    rows = motion_rows(x, 0.5, 2.0)
    np.testing.assert_allclose(rows[:, VELOCITY], [2.0, 4.0, -2.0])
    np.testing.assert_allclose(rows[:, TIME], [0.5, 1.0, 1.5])
    assert np.all(rows[:, VOLTS] == 2.0) and np.all(rows[:, SENSED] == x)


def test_numbers_of_numpy_are_numbers():
    parameter = Parameter("size", "m", 0.0, 1.0, "a size")
    assert parameter.check(np.int64(1), "it") == 1.0
    assert parameter.check(np.float32(0.5), "it") == 0.5
    with pytest.raises(ConfigError, match="must be a number"):
        parameter.check(np.bool_(True), "it")
    assert issubclass(DriveForce, Effect)
