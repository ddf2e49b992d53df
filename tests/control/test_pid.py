from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from rtcomp.control import pid
from rtcomp.control.limits import limit_state, limit_step, limit_vector
from rtcomp.control.pid import pid_preset, pid_state, pid_step, pid_vector
from rtcomp.errors import ConfigError

T = 1e-3


def run(p, errors, positions=None, step=pid_step):
    s = pid_state()
    positions = np.zeros(len(errors)) if positions is None else positions
    return np.array([step(p, s, e, x, 0.0) for e, x in zip(errors, positions, strict=True)])


def test_ramp_of_error_gives_the_closed_form():
    """e = t: kp t + ki t^2 / 2 + kd (1 - exp(-t / Tf)), exactly at the ticks."""
    t = np.arange(400) * T
    p = pid_vector(3.0, 7.0, 0.2, period=T, derivative_time=0.02)
    expected = 3.0 * t + 3.5 * t**2 + 0.2 * (1.0 - np.exp(-t / 0.02))
    assert np.allclose(run(p, t), expected, rtol=1e-12, atol=1e-13)


def test_step_of_error_gives_proportional_plus_ramp():
    p = pid_vector(2.0, 5.0, 0.1, period=T)
    t = np.arange(200) * T
    assert np.allclose(run(p, np.ones(200)), 2.0 + 5.0 * t, rtol=1e-12)


@settings(max_examples=25, deadline=None)
@given(
    st.floats(0.0, 10.0),
    st.floats(0.0, 50.0),
    st.floats(0.0, 1.0),
    st.floats(2e-3, 0.1),
    st.integers(0, 1000),
)
def test_equals_the_linear_system_for_any_piecewise_straight_error(kp, ki, kd, tf, seed):
    errors = np.random.default_rng(seed).normal(size=120).cumsum()
    errors -= errors[0]
    t = np.arange(len(errors)) * T
    expected = kp * errors
    expected += kd * signal.lsim(([1.0, 0.0], [tf, 1.0]), errors, t, interp=True)[1]
    expected += ki * signal.lsim(([1.0], [1.0, 0.0]), errors, t, interp=True)[1]
    got = run(pid_vector(kp, ki, kd, period=T, derivative_time=tf), errors)
    assert np.allclose(got, expected, rtol=1e-7, atol=1e-7 * (1 + np.abs(expected).max()))


def test_closed_loop_step_response_is_that_of_the_sampled_linear_system():
    """PI on an integrator 1/s, held commands: poles of the sampled loop from linear algebra."""
    kp, ki, n = 40.0, 300.0, 300
    p, s, x, out = pid_vector(kp, ki, period=T), pid_state(), 0.0, []
    for _ in range(n):
        out.append(x)
        x += T * pid_step(p, s, 1.0 - x, x, 0.0)
    # State: position, integral part, error of the tick before.
    loop = np.array(
        [[1 - T * (kp + ki * T / 2), T, T * ki * T / 2], [-ki * T / 2, 1, ki * T / 2], [-1, 0, 0]]
    )
    drive = np.array([T * (kp + ki * T / 2), ki * T / 2, 1.0])
    # The first tick adds no area: start with minus the area that an error of 1 before it would have given.
    state, expected = np.array([0.0, -ki * T, 1.0]), []
    for _ in range(n):
        expected.append(state[0])
        state = loop @ state + drive
    assert np.allclose(out, expected, atol=1e-12)
    assert max(out) > 1.0


def test_derivative_on_measurement_does_not_see_the_reference_jump():
    p = pid_vector(1.0, 0.0, 10.0, period=T, derivative="measurement")
    on_error = pid_vector(1.0, 0.0, 10.0, period=T, derivative="error")
    errors = np.concatenate((np.zeros(5), np.ones(5)))
    assert np.abs(run(p, errors)).max() == 1.0
    assert np.abs(run(on_error, errors)).max() > 1000.0
    positions = np.linspace(0.0, 1.0, 10)
    assert np.allclose(run(p, -positions, positions), run(on_error, -positions, positions))


def saturated_step(anti_windup: str) -> tuple[float, float]:
    """Overshoot (share of the step) and settling time (s) of a 1 kg mass, 1 N limit, stepped by 1 m."""
    kp, ki, kd, limit = 20.0, 5.0, 10.0, 1.0
    p = pid_vector(kp, ki, kd, period=T, anti_windup=anti_windup, derivative="measurement")
    clamp, s, c = limit_vector(limit, T), pid_state(), limit_state()
    x = v = excess = 0.0
    xs = []
    for _ in range(15000):
        asked = pid_step(p, s, 1.0 - x, x, excess)
        applied = limit_step(clamp, c, asked)
        excess = applied - asked
        x += T * v + 0.5 * T * T * applied
        v += T * applied
        xs.append(x)
    far = np.flatnonzero(np.abs(np.array(xs) - 1.0) > 0.02)
    return max(xs) - 1.0, (far[-1] + 1) * T


@pytest.mark.parametrize("how", ["back-calculation", "conditional"])
def test_recovers_from_saturation_with_little_overshoot(how):
    overshoot, settled = saturated_step(how)
    wound_up, late = saturated_step("none")
    assert overshoot < 0.05
    assert overshoot < 0.5 * wound_up
    assert settled < late
    assert settled < 6.0


@pytest.mark.parametrize("how", ["back-calculation", "conditional"])
def test_integral_does_not_grow_while_the_drive_is_saturated(how):
    """An hour of unreachable reference leaves as quickly as a second of it."""
    p = pid_vector(1.0, 10.0, period=T, anti_windup=how)
    clamp = limit_vector(1.0, T)

    def ticks_to_leave(saturated: int) -> int:
        s, c, excess = pid_state(), limit_state(), 0.0
        for _ in range(saturated):
            asked = pid_step(p, s, 5.0, 0.0, excess)
            excess = limit_step(clamp, c, asked) - asked
        for n in range(100000):
            asked = pid_step(p, s, -0.5, 0.0, excess)
            applied = limit_step(clamp, c, asked)
            excess = applied - asked
            if applied < 1.0:
                return n
        return 100000

    assert ticks_to_leave(1000) < 250
    assert abs(ticks_to_leave(100000) - ticks_to_leave(1000)) <= 1


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
    st.floats(-50.0, 50.0),
    st.sampled_from(["error", "measurement"]),
)
def test_preset_takes_over_without_a_bump(error, position, volts, derivative):
    p, s = pid_vector(20.0, 30.0, 2.0, period=T, derivative=derivative), pid_state()
    pid_preset(p, s, error, position, volts)
    assert pid_step(p, s, error, position, 0.0) == pytest.approx(volts + 30.0 * T * error, abs=1e-9)


def test_integral_part_stays_within_the_voltage_limit():
    p, s = pid_vector(0.0, 100.0, period=T, anti_windup="none", voltage_limit=3.0), pid_state()
    for _ in range(1000):
        out = pid_step(p, s, 1.0, 0.0, 0.0)
    assert out == 3.0


def test_a_measurement_that_is_no_number_leaves_the_state_alone():
    p, s = pid_vector(2.0, 5.0, 0.1, period=T), pid_state()
    pid_step(p, s, 1.0, 0.0, 0.0)
    before = s.copy()
    assert math.isnan(pid_step(p, s, math.nan, 0.0, 0.0))
    assert math.isnan(pid_step(p, s, 0.0, math.inf, 0.0))
    assert np.array_equal(s, before)
    assert math.isfinite(pid_step(p, s, 1.0, 0.0, math.nan))


def test_compiled_and_python_agree():
    errors = np.random.default_rng(1).normal(size=300)
    p = pid_vector(2.0, 5.0, 0.1, period=T, anti_windup="conditional", derivative="measurement")
    assert np.allclose(run(p, errors, -errors), run(p, errors, -errors, pid_step.py_func), rtol=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        {"kp": -1.0},
        {"ki": math.nan},
        {"kd": -0.1},
        {"period": 0.0},
        {"derivative_time": -1.0},
        {"tracking_time": 0.0},
        {"voltage_limit": 0.0},
        {"derivative": "both"},
        {"anti_windup": "magic"},
    ],
)
def test_settings_that_make_no_sense_are_refused_in_one_line(change):
    values = {"kp": 1.0, "ki": 1.0, "kd": 1.0, "period": T, **change}
    with pytest.raises(ConfigError, match=next(iter(change))) as caught:
        pid_vector(**values)
    assert "\n" not in str(caught.value)


def test_state_and_parameter_sizes_are_as_named():
    assert pid_vector(1.0, period=T).shape == (pid.PARAMETERS,)
    assert pid_state().shape == (pid.STATES,)
