"""The simulation against closed forms, at rest, in resonance, in sliding, and at 1e8 N/m."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moved import drive, stage

from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.stage.simulate import Simulator

K = 1e8
LEVEL = {"coulomb": 4.0, "static": 5.0, "stribeck_velocity": 1e-3, "viscous": 5.0}
BANK = [
    {"stiffness": 0.5 * K, "reach": 2e-8},
    {"stiffness": 0.3 * K, "reach": 6e-8},
    {"stiffness": 0.2 * K, "reach": 2e-7},
]
ELEMENTS = [
    {"stiffness": 0.5 * K, "weight": 0.3},
    {"stiffness": 0.3 * K, "weight": 0.3},
    {"stiffness": 0.2 * K, "weight": 0.4},
]
STIFF = {
    "stop": BANK,
    "lugre": {"model": "lugre", "stiffness": K, "damping": 1e3, **LEVEL},
    "lugre, undamped": {"model": "lugre", "stiffness": K, **LEVEL},
    "gms": {"model": "gms", "attraction": 100.0, "elements": ELEMENTS, **LEVEL},
    "leuven": {"model": "leuven", "elements": BANK, "damping": 1e3, **LEVEL},
    "leuven, undamped": {"model": "leuven", "elements": BANK, **LEVEL},
    "modified-leuven": {"model": "modified-leuven", "elements": BANK, "damping": 1e3, **LEVEL},
    "modified-leuven, undamped": {"model": "modified-leuven", "elements": BANK, **LEVEL},
}


def relative(a, b):
    return np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2))


@pytest.mark.parametrize(("mass", "stiffness"), [(1.0, 1e4), (0.5, 1e6), (5.0, 1e8)])
def test_a_mass_on_a_spring_keeps_time_for_a_thousand_cycles(mass, stiffness):
    spring = {"name": "parallel-spring", "stiffness": stiffness, "cubic": 0.0}
    omega = np.sqrt(stiffness / mass)
    period = 0.37 / omega
    simulator = Simulator(stage(mass, effects=[spring], rate=1.0 / period), start=1e-6)
    t = period * np.arange(1, 17_001)
    out = drive(simulator, np.zeros(t.size), period)
    assert t[-1] * omega / (2 * np.pi) > 1000
    assert np.allclose(out[:, 0], 1e-6 * np.cos(omega * t), rtol=0, atol=1e-6 * 2e-3)
    assert simulator.time == pytest.approx(t[-1])


@pytest.mark.parametrize("coefficient", [1.0, 100.0, 1e4])
def test_viscous_friction_against_the_exponential(coefficient):
    mass, force = 2.0, 4.0
    t = 1e-3 * np.arange(1, 1001)
    out = drive(Simulator(stage(mass, viscous=coefficient)), np.ones(1000), 1e-3)
    tau = mass / coefficient
    speed = force / coefficient * -np.expm1(-t / tau)
    assert np.allclose(out[:, 1], speed, rtol=2e-3, atol=1e-4 * speed[-1])
    exact = force / coefficient * t - speed * tau
    assert np.allclose(out[:, 0], exact, rtol=2e-3, atol=1e-5 * exact[-1])
    # Let go, it coasts m v / c and stops.
    simulator = Simulator(stage(mass, viscous=coefficient))
    drive(simulator, np.ones(100), 1e-3)
    before, v = simulator.position, simulator.velocity
    drive(simulator, np.zeros(200), max(1e-3, 0.1 * tau))
    assert simulator.position - before == pytest.approx(v * tau, rel=5e-3)
    assert abs(simulator.velocity) < 1e-6 * v


@pytest.mark.parametrize("coefficient", [1e-2, 1.0, 1e4, 1e8])
def test_quadratic_drag_against_the_hyperbolic_tangent(coefficient):
    mass, force = 2.0, 4.0
    fastest, tau = np.sqrt(force / coefficient), mass / np.sqrt(force * coefficient)
    drag = {"name": "quadratic-drag", "coefficient": coefficient}
    t = 0.05 * tau * np.arange(1, 101)
    out = drive(Simulator(stage(mass, effects=[drag], rate=1.0 / t[0])), np.ones(t.size), t[0])
    assert np.allclose(out[:, 1], fastest * np.tanh(t / tau), rtol=2e-3, atol=1e-4 * fastest)


def test_a_free_mass_accelerates():
    out = drive(Simulator(stage(2.0)), np.ones(500), 1e-3)
    assert out[-1, 1] == pytest.approx(4.0 / 2.0 * 0.5, rel=1e-9)
    assert out[-1, 0] == pytest.approx(0.5 * 4.0 / 2.0 * 0.25, rel=1e-9)


def test_weight_pulls_from_the_first_instant():
    pull = {"name": "constant-force", "force": -3.0}
    for rate in (10.0, 1e4):
        simulator = Simulator(stage(1.5, effects=[pull], rate=rate))
        simulator.advance(0.0, 0.1)
        assert simulator.velocity == pytest.approx(-0.2, rel=1e-9)
        assert simulator.position == pytest.approx(-0.01, rel=1e-9)


def test_sliding_under_constant_force_and_sticking_below_the_level():
    """Presliding of 0.1 um against millimetres of sliding: what exceeds F_c accelerates."""
    friction = [{"stiffness": 3e7, "reach": 1e-7}]  # 3 N
    slides = drive(Simulator(stage(2.0, friction)), np.full(500, 1.25), 1e-3)
    assert slides[-1, 1] == pytest.approx((5.0 - 3.0) / 2.0 * 0.5, rel=1e-3)
    assert slides[-1, 2] == pytest.approx(3.0)
    sticks = drive(
        Simulator(stage(2.0, friction, viscous=500.0)), np.minimum(np.arange(1000) / 400, 0.5), 1e-3
    )
    assert sticks[-1, 0] == pytest.approx(2.0 / 3e7, rel=1e-6)
    assert np.abs(sticks[:, 0]).max() <= 1.3e-7


def test_pulled_slowly_it_draws_the_virgin_curve():
    widths, weights = np.array([4e-6, 6e-6, 10e-6]), np.array([8e5, 4e5, 1e5])
    friction = {"model": "interval", "widths": widths.tolist(), "weights": weights.tolist()}
    corners, force = HysteresisModel(IntervalBasis(widths), weights).virgin_curve()
    simulator = Simulator(stage(0.5, friction, viscous=200.0))
    pull = np.linspace(0.0, 0.98 * force[-1], 4000)
    out = drive(simulator, pull / 4.0, 2.5e-3)
    assert np.allclose(out[:, 0], np.interp(pull, force, corners), rtol=0, atol=2e-3 * corners[-1])
    # And back: the branch is the virgin curve doubled.
    top = simulator.position
    back = np.linspace(pull[-1], -0.9 * force[-1], 4000)
    down = drive(simulator, back / 4.0, 2.5e-3)
    expected = top - 2 * np.interp((pull[-1] - back) / 2, force, corners)
    assert np.allclose(down[:, 0], expected, rtol=0, atol=4e-3 * corners[-1])


def open_loop(s, substeps):
    """Slow swings from presliding through break-away to millimetres, the command held over each period."""
    t = np.arange(round(0.3 * s.rate)) / s.rate
    volts = np.sin(2 * np.pi * 7 * t) + 0.8 * np.sin(2 * np.pi * 3 * t)
    return drive(Simulator(s, substeps=substeps), volts, 1.0 / s.rate)


def closed_loop(s, substeps, amplitude):
    """A PID on the true position, at 1 kHz."""
    rate, simulator = s.rate, Simulator(s, substeps=substeps)
    t = np.arange(round(0.6 * rate)) / rate
    reference = amplitude * np.sin(2 * np.pi * 2 * t) * np.minimum(t / 0.1, 1)
    out = np.empty((t.size, 3))
    integral = last = 0.0
    for k, r in enumerate(reference):
        x = simulator.position
        integral = np.clip(integral + 2e5 * (r - x) / rate, -10, 10)
        volts = float(np.clip(2e4 * (r - x) + integral - 100.0 * (x - last) * rate, -10, 10))
        last = x
        simulator.advance(volts, 1.0 / rate)
        out[k] = simulator.position, simulator.velocity, simulator.friction
    return out


@pytest.mark.parametrize("mass", [0.5, 2.0, 5.0])
@pytest.mark.parametrize("name", STIFF)
def test_at_1e8_newtons_a_metre_half_the_step_changes_less_than_a_thousandth(name, mass):
    fast = stage(mass, STIFF[name], viscous=8.0, rate=5000.0)
    slow = stage(mass, STIFF[name], viscous=8.0)
    for what, coarse, fine in (
        ("open loop", open_loop(fast, 1), open_loop(fast, 2)),
        ("closed loop, presliding", closed_loop(slow, 1, 6e-5), closed_loop(slow, 2, 6e-5)),
        ("closed loop, sliding", closed_loop(slow, 1, 5e-4), closed_loop(slow, 2, 5e-4)),
    ):
        assert np.abs(fine[:, 2]).max() > 3.5  # it did break away
        assert relative(coarse[:, 0], fine[:, 0]) < 1e-3, what
        assert relative(coarse[:, 2], fine[:, 2]) < 1e-3, what


@pytest.mark.parametrize("name", ["lugre, undamped", "lugre", "leuven", "modified-leuven"])
def test_the_integration_is_second_order(name):
    """A step four times as long costs sixteen times the error (four, were it first order)."""
    s = stage(2.0, STIFF[name], viscous=8.0, rate=5000.0)
    truth = open_loop(s, 16)
    coarse, fine = (relative(open_loop(s, n)[:, 0], truth[:, 0]) for n in (0.25, 1))
    assert coarse > 7 * fine


@pytest.mark.parametrize("following", [0.0, 1.0])
def test_stop_elements_whose_level_falls_with_speed_need_no_finer_steps(following):
    """Their level is that of the end of a step, as their force is; with its middle's they were 0.1 % off."""
    soft = [{"stiffness": 3e5, "reach": 4e-6}, {"stiffness": 1e5, "reach": 3e-5}]
    falls = [
        {"name": "stribeck", "rise": 0.4, "velocity": 2e-2, "following": following},
        {"name": "frictional-lag", "time_constant": 5e-3},
    ]
    s, t = stage(1.0, soft, falls, 2000.0, viscous=5.0), np.arange(3000) / 2000.0
    volts = 1.3 * np.sin(2 * np.pi * 3 * t) + 0.5 * np.sin(2 * np.pi * 11 * t)
    plain, fine = (drive(Simulator(s, substeps=n), volts, 1.0 / s.rate) for n in (1, 8))
    assert relative(plain[:, 0], fine[:, 0]) < 1e-4
    assert relative(plain[:, 2], fine[:, 2]) < 2e-4


def test_undamped_ringing_neither_grows_nor_fades_nor_drifts_in_time():
    """A kick on stuck contacts of 1e8 N/m: 2,250 Hz for a second, in closed form."""
    mass, period = 0.5, 1e-4
    simulator = Simulator(stage(mass, [{"stiffness": K, "reach": 1e-6}], rate=1.0 / period))
    t = period * np.arange(1, 10_001)
    out = drive(simulator, np.full(t.size, 2.5), period)
    expected = 10.0 / K * (1 - np.cos(np.sqrt(K / mass) * t))
    assert relative(out[:, 0], expected) < 1e-3


@settings(max_examples=15, deadline=None)
@given(st.sampled_from([*STIFF, "none"]), st.integers(0, 10_000))
def test_no_more_energy_comes_out_than_the_drive_put_in(name, seed):
    """Kinetic energy never exceeds the work of the drive, whatever the command: friction only takes."""
    s = stage(1.0, STIFF.get(name), viscous=2.0)
    rng = np.random.default_rng(seed)
    volts = np.repeat(rng.uniform(-3.0, 3.0, 30), 10)
    out = drive(Simulator(s), volts, 1e-3)
    x = np.concatenate([[0.0], out[:, 0]])
    work = np.cumsum(4.0 * volts * np.diff(x))
    kinetic = 0.5 * 1.0 * out[:, 1] ** 2
    assert (kinetic <= work + 1e-3 * np.abs(work).max() + 1e-12).all()


def test_energy_fades_when_let_go():
    """From a displaced spring with friction: mechanical energy only falls, then rests."""
    spring = {"name": "parallel-spring", "stiffness": 1e4, "cubic": 0.0}
    simulator = Simulator(stage(1.0, [{"stiffness": 1e6, "reach": 1e-6}], [spring]), start=1e-3)
    out = drive(simulator, np.zeros(3000), 1e-3)
    energy = 0.5 * 1e4 * out[:, 0] ** 2 + 0.5 * out[:, 1] ** 2
    stored = 0.5 * 1e6 * 1e-6**2
    assert (np.diff(energy) <= 2 * stored).all()
    assert energy[-1] < 0.2 * energy[0]
    # Each half cycle loses 2 F_c / k of amplitude: Coulomb's own law.
    turns = np.abs(out[:, 0])[1:-1][
        (np.diff(np.abs(out[:, 0]))[:-1] > 0) & (np.diff(np.abs(out[:, 0]))[1:] < 0)
    ]
    assert np.allclose(np.diff(turns[:3]), -2 * 1.0 / 1e4, rtol=0.05)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 1000))
def test_a_period_in_two_parts_is_the_same_period(seed):
    s = stage(2.0, STIFF["stop"], viscous=8.0)
    volts = np.random.default_rng(seed).uniform(-2.0, 2.0, 50)
    whole = drive(Simulator(s), volts, 1e-3)
    parts = drive(Simulator(s), np.repeat(volts, 2), 5e-4)[1::2]
    assert relative(whole[:, 0], parts[:, 0]) < 1e-3


def test_reset_repeats_the_run_and_seeds_differ():
    s = stage(2.0, STIFF["gms"], sensor={"noise": 1e-8})
    one, other = Simulator(s, seed=1), Simulator(s, seed=2)

    def measured(simulator):
        out = []
        for k in range(200):
            simulator.advance(np.sin(0.1 * k), 1e-3)
            out.append(simulator.measure())
        return out

    first = measured(one)
    one.reset()
    assert measured(one) == first
    assert measured(other) != first


def test_the_sensor_adds_noise_and_rounds_and_the_axis_does_not_feel_it():
    s = stage(1.0, sensor={"noise": 20e-9, "resolution": 10e-9})
    simulator = Simulator(s, seed=3)
    seen = np.array([simulator.measure() for _ in range(20_000)])
    assert simulator.position == 0.0
    assert np.std(seen) == pytest.approx(np.hypot(20e-9, 10e-9 / np.sqrt(12)), rel=0.03)
    assert np.allclose(seen / 10e-9, np.round(seen / 10e-9), atol=1e-6)
