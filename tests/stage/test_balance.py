"""Both sides of the force balance agree on what the stage itself made, and differ on wrong beliefs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp import physics
from rtcomp.stage.balance import (
    PARTS,
    around_rows,
    bandwidth,
    between_rows,
    force_balance,
    forces,
    known_force,
    parts_of_drive,
    zero_phase,
)
from rtcomp.stage.simulate import Simulator
from rtcomp.stage.stage import Stage

LEUVEN = Stage.load(Path(__file__).parents[2] / "configs" / "leuven.yaml")
QUIET = LEUVEN.with_changes(sensor={"noise": 0.0, "resolution": 0.0})


def recorded(stage, seconds=8.0, stroke=3e-4, seed=0):
    """Closed loop along three sines, presliding and sliding: time, position, voltage."""
    rate, simulator = stage.rate, Simulator(stage, seed=seed)
    t = np.arange(round(seconds * rate)) / rate
    fade = np.minimum(t / 0.5, 1.0)
    reference = fade * stroke * (np.sin(2 * np.pi * 0.4 * t) + 0.3 * np.sin(2 * np.pi * 1.7 * t))
    reference += fade * 2e-5 * np.sin(2 * np.pi * 5 * t)
    position, voltage = np.empty(t.size), np.empty(t.size)
    integral = last = volts = 0.0
    for k in range(t.size):
        if k:
            simulator.advance(volts, 1.0 / rate)
        x = position[k] = simulator.measure()
        integral = np.clip(integral + 2e5 * (reference[k] - x) / rate, -10.0, 10.0)
        volts = float(np.clip(2e4 * (reference[k] - x) + integral - 100.0 * (x - last) * rate, -10, 10))
        voltage[k], last = volts, x
    return t, position, voltage


@pytest.fixture(scope="module")
def quiet():
    return recorded(QUIET)


def test_the_two_sides_agree_within_one_per_cent(quiet):
    balance = force_balance(QUIET, *quiet)
    assert np.abs(balance.force_motion).max() > 4.0  # it did slide
    assert balance.relative_error < 0.01


@pytest.mark.parametrize(
    "friction",
    [
        {"model": "lugre", "stiffness": 4e5, "damping": 300.0, "coulomb": 4.0, "static": 4.8},
        {"model": "gms", "attraction": 60.0, "coulomb": 4.0, "static": 4.8,
         "elements": [{"stiffness": 3e5, "weight": 0.4}, {"stiffness": 1e5, "weight": 0.6}]},
        {"model": "leuven", "damping": 300.0, "coulomb": 4.0, "static": 4.8,
         "elements": [{"stiffness": 3e5, "reach": 4e-6}, {"stiffness": 2e5, "reach": 2e-5}]},
    ],
    ids=lambda f: f["model"],
)  # fmt: skip
def test_they_agree_for_every_kind_of_friction(friction):
    stage = QUIET.with_changes(stage={"friction": friction})
    assert force_balance(stage, *recorded(stage, 4.0)).relative_error < 0.01


def test_a_wrong_belief_shows():
    """Each believed wrongly by itself, on a motion that exercises it."""
    fast = QUIET.with_changes(stage={"viscous": 60.0})
    t, position, voltage = recorded(fast, 4.0, stroke=2e-3)
    right = force_balance(fast, t, position, voltage).relative_error
    weaker = [{**e, "stiffness": 0.9 * e["stiffness"]} for e in fast.to_dict()["stage"]["friction"]]
    for change in ({"mass": 2.6}, {"viscous": 40.0}, {"force_constant": 3.8}, {"friction": weaker}):
        wrong = force_balance(fast.with_changes(stage=change), t, position, voltage).relative_error
        assert wrong > 3 * right and wrong > 0.005, change


def test_the_wrong_mass_shows_in_proportion():
    """Free mass: the whole force is inertia, so ten per cent of mass are ten per cent of force."""
    free = Stage.from_dict({"stage": {"mass": 2.0, "force_constant": 4.0, "voltage_limit": 10.0}})
    simulator = Simulator(free)
    t = np.arange(4000) / 1000.0
    voltage = np.sin(2 * np.pi * 3 * t) + np.sin(2 * np.pi * 8 * t)
    position = np.empty(t.size)
    for k, u in enumerate(voltage):
        position[k] = simulator.position
        simulator.advance(float(u), 1e-3)
    assert force_balance(free, t, position, voltage).relative_error < 0.01
    wrong = free.with_changes(stage={"mass": 2.2})
    assert force_balance(wrong, t, position, voltage).relative_error == pytest.approx(0.1 / 1.1, rel=0.05)


def test_noise_of_an_interferometer_leaves_the_balance_useful():
    assert force_balance(LEUVEN, *recorded(LEUVEN)).relative_error < 0.05


@pytest.mark.parametrize("constant", [0.5e-3, 3e-3, 2e-2])
def test_the_force_of_a_lag_over_a_row_is_its_mean(constant):
    row, count = 1e-3, 40
    lag = [physics.build({"name": "drive-lag", "time_constant": constant})]
    chain = [*(e for e in QUIET.chain if e.name == "drive-force"), *lag]
    time, still = row * np.arange(count + 1), np.zeros(count + 1)
    chain.sort(key=lambda e: e.order)
    given = forces(QUIET, chain, time, still, still, still, np.append(0.0, np.ones(count)), parts=PARTS).drive
    fall = np.exp(-time / constant)
    mean = 1.0 + constant / row * np.diff(fall)
    at = QUIET.force_constant
    np.testing.assert_allclose(given[1:] / at, mean, atol=0.09 * (row / constant / PARTS) ** 2)


def test_the_bandwidth_is_what_is_told(quiet):
    assert force_balance(QUIET, *quiet).bandwidth_hz == bandwidth(1000.0) == 100.0
    assert bandwidth(200.0) == 20.0
    assert force_balance(QUIET, *quiet, bandwidth_hz=30.0).bandwidth_hz == 30.0


def test_the_filter_delays_nothing():
    t = np.arange(2000) / 1000.0
    slow = np.sin(2 * np.pi * 3 * t)
    assert np.abs(zero_phase(slow, 100.0, 1000.0) - slow)[100:-100].max() < 1e-4


def test_known_force_is_everything_but_the_friction_model():
    effects = [
        {"name": "cogging", "amplitude": 1.2, "period": 5e-4, "phase": 0.3},
        {"name": "parallel-spring", "stiffness": 3e3, "cubic": 0.0},
        {"name": "constant-force", "force": 0.4},
    ]
    stage = QUIET.with_changes(stage={"effects": effects})
    t = np.arange(1000) * 1e-3
    x = 1e-3 * np.sin(2 * np.pi * t)
    v = 1e-3 * 2 * np.pi * np.cos(2 * np.pi * t)
    expected = (
        8.0 * v
        + 250.0 * np.exp(-((v / 5e-3) ** 2)) * v
        + 3e3 * x
        - 0.4
        - 1.2 * np.sin(2 * np.pi * x / 5e-4 + 0.3)
    )
    assert np.allclose(known_force(stage, t, x, v), expected, rtol=0, atol=1e-12)
    assert np.allclose(known_force(stage, t, x, v, viscous=False), expected - 8.0 * v, rtol=0, atol=1e-12)


def test_known_force_keeps_friction_that_is_listed_beside_the_model():
    """A second friction under ``effects`` is known; only the model that is to be identified is left out."""
    drag = {"name": "quadratic-drag", "coefficient": 400.0}
    stage = QUIET.with_changes(stage={"effects": [drag], "viscous": 0.0, "micro_damping": 0.0})
    t = np.arange(100) * 1e-3
    v = np.linspace(-0.05, 0.05, 100)
    assert np.allclose(known_force(stage, t, 0 * v, v), 400.0 * np.abs(v) * v, rtol=0, atol=1e-12)


@pytest.mark.parametrize("following", [0.0, 1.0])
@pytest.mark.parametrize("lag", [0.0, 3e-3, 0.2])
def test_friction_that_falls_with_speed_is_not_late_where_rows_are_long(lag, following):
    """Its level is that of the speed at the row, not half a row before: a lag would come out too small."""
    chain = [
        physics.build({"name": "frictional-lag", "time_constant": lag}),
        physics.build({"name": "stribeck", "rise": 0.4, "velocity": 4e-3, "following": following}),
        QUIET.friction,
    ]

    def friction(parts):
        time = np.arange(1500 * parts) / (1000.0 * parts)
        angle = 8 * np.pi * time
        x, v, a = 2e-4 * np.sin(angle), 16e-4 * np.pi * np.cos(angle), -1.28e-2 * np.pi**2 * np.sin(angle)
        return forces(QUIET, chain, time, x, v, a, 0.0 * time).friction[::parts]

    fine, coarse = friction(32), friction(1)
    rows = np.arange(fine.size)
    late = np.interp(rows - 0.5, rows, fine)
    sliding = (np.abs(np.sin(8e-3 * np.pi * rows)) < 0.5) & (rows > 200)  # what changes is the level
    assert np.std((coarse - fine)[sliding]) < 0.1 * np.std((late - fine)[sliding])


@pytest.mark.parametrize("speed", [1e-3, 1e-2, 3e-2])
def test_the_force_of_a_ripple_over_a_row_is_its_mean(speed):
    """At 30 mm/s a row is a third of the period; the push beside it is the one at the row."""
    row, count, period = 1e-3, 200, 1e-4
    effects = [
        {"name": "torque-ripple", "amplitude": 0.3, "period": period, "phase": 0.4},
        {"name": "cogging", "amplitude": 0.5, "period": period, "phase": -1.0},
    ]
    chain = [*(e for e in QUIET.chain if e.name == "drive-force"), *(physics.build(e) for e in effects)]
    chain.sort(key=lambda e: e.order)
    time = row * np.arange(count)
    x, still, ones = speed * time, np.zeros(count), np.ones(count)
    found = forces(QUIET, chain, time, x, speed * ones, still, ones, parts=parts_of_drive(chain))
    angle = 2.0 * np.pi * x / period
    mean = 1.0 - 0.3 * period / (2.0 * np.pi * speed * row) * np.diff(np.cos(angle + 0.4))
    np.testing.assert_allclose(
        found.drive[1:] / QUIET.force_constant, mean, atol=0.3 * 0.01 * (speed / 3e-2) ** 2
    )
    np.testing.assert_allclose(found.push, 0.5 * np.sin(angle - 1.0), atol=1e-9)


@pytest.mark.parametrize("order", ["C", "F"])
def test_forces_around_rows_are_weighed_one_ten_one(order):
    force = np.asarray(np.random.default_rng(3).standard_normal((50, 3)), order=order)
    before = force.copy()
    found = around_rows(force)
    assert np.array_equal(force, before) and np.array_equal(found[[0, -1]], force[[0, -1]])
    np.testing.assert_allclose(found[1:-1], (force[:-2] + 10.0 * force[1:-1] + force[2:]) / 12.0, rtol=1e-14)
    assert np.array_equal(around_rows(np.ascontiguousarray(force[:, 1])), found[:, 1])


@given(st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4), st.floats(0.0, 1.0))
@settings(max_examples=50, deadline=None)
def test_between_rows_a_position_is_the_cubic_through_both(terms: list[float], share: float) -> None:
    cubic = np.polynomial.Polynomial(terms)
    time = np.arange(4) * 0.5
    motion = np.column_stack([time, cubic(time), cubic.deriv()(time), np.zeros(4), np.zeros(4)])
    assert between_rows(motion, 2, share) == pytest.approx(float(cubic(1.0 - 0.5 * share)), abs=1e-9)


@pytest.mark.parametrize("own", [0.03, 0.1, 0.3])
def test_a_second_mass_weighs_what_its_oscillation_makes_of_it(own: float) -> None:
    """Of its own frequency, per row, and driven at 0.02: m1 + m2 / (1 - (w / w_own)^2)."""
    rate, driven, mass, share = 1000.0, 0.02, 2.0, 0.4
    t = np.arange(20_000) / rate
    x = 1e-3 * np.sin(2 * np.pi * driven * rate * t) * np.clip(t / 5.0, 0.0, 1.0) ** 3
    second = physics.build(
        {"name": "resonance", "mass_ratio": share, "frequency": own * rate, "damping": 0.1}
    )
    bare = Stage.from_dict(
        {"stage": {"mass": mass, "force_constant": 1.0, "voltage_limit": 1.0}, "rate": rate}
    )
    a = np.diff(x, 2, prepend=x[0], append=x[-1]) * rate**2
    f = forces(bare, [second], t, x, np.gradient(x, t), a, np.zeros(t.size))
    needed, rows = f.mass * a - f.others(), slice(8000, 19_000)
    found = float(a[rows] @ needed[rows] / (a[rows] @ a[rows]))
    swung = 1.0 - (driven / own) ** 2 + 2j * 0.1 * driven / own
    answer = mass * (1.0 - share + share * (1.0 + 2j * 0.1 * driven / own) / swung)
    assert found == pytest.approx(answer.real, rel=2e-3)
