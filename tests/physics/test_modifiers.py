"""What modifies friction: each against its own law, and on every model of the catalogue."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp import physics
from rtcomp.errors import ConfigError
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.physics.rows import motion_rows, over_rows
from rtcomp.physics.slow import FRESH
from rtcomp.physics.wires import DRIVE, FRICTION, GRAIN, REACH, SCALE, VELOCITY

BANK = MaxwellSlip([(8e5, 1e-6), (4e5, 3e-6), (2e5, 7e-6)])
MODELS = ["maxwell-slip", "dahl", "lugre", "gms", "leuven", "modified-leuven"]
FINE = 1e-8


def effect(name, **values):
    return physics.build({"name": name, **values})


def chain(*effects, model=BANK):
    return sorted([model, *effects], key=lambda e: (e.place, e.order))


def path(*corners, step=FINE):
    """Positions through `corners` from 0, at most `step` apart, all corners among them."""
    x = [0.0]
    for corner in corners:
        count = max(round(abs(corner - x[-1]) / step), 1)
        x += list(np.linspace(x[-1], corner, count + 1)[1:])
    return np.array(x[1:])


def force(x, *effects, model=BANK, step=1e-3, drive=0.0, grain=0.0):
    rows = motion_rows(np.asarray(x, dtype=float), step)
    rows[:, DRIVE], rows[:, GRAIN] = drive, grain
    return over_rows(chain(*effects, model=model), rows)[:, FRICTION]


def work(x, f):
    return float(np.sum(np.diff(x) * (f[1:] + f[:-1]) / 2))


def loop(low, high, *effects):
    """Positions and force of the third cycle between two positions, after sliding far both ways."""
    start = path(5e-5, -5e-5, low)
    cycle = low + np.concatenate([path(high - low), (high - low) + path(low - high)])
    x = np.concatenate([start, cycle, cycle, cycle])
    model = MaxwellSlip([(8e5, 1e-6)])
    last = slice(len(x) - len(cycle) - 1, len(x))
    return x[last], force(x, *effects, model=model)[last]


def at_one_level(name):
    """The model's example with one level, 3 N (4.4 N of the stop elements), and no damping."""
    example = physics.entry(name).example
    same = {k: v for k, v in {"damping": 0.0, "viscous": 0.0, "static": 3.0}.items() if k in example}
    return physics.entry(name).from_dict({**example, **same})


# asymmetric-friction


@pytest.mark.parametrize("name", MODELS)
def test_asymmetry_makes_one_branch_stiffer_up_to_the_same_level(name):
    model = at_one_level(name)
    a = 0.2
    up = force(path(5e-4), effect("asymmetric-friction", asymmetry=a), model=model)
    down = force(path(-5e-4), effect("asymmetric-friction", asymmetry=a), model=model)
    plain = force(path(5e-4), model=model)
    assert up[-1] == pytest.approx(-down[-1], rel=1e-3)
    assert up[-1] == pytest.approx(plain[-1], rel=1e-3)
    assert up[0] / plain[0] == pytest.approx(1 + a, rel=0.02)
    assert -down[0] / plain[0] == pytest.approx(1 - a, rel=0.02)


def test_an_asymmetric_loop_that_yields_both_ways_closes_and_has_the_area_of_its_parallelogram():
    a = 0.3
    x, f = loop(-4e-6, 4e-6, effect("asymmetric-friction", asymmetry=a))
    assert f[0] == pytest.approx(f[-1], abs=1e-9)
    level = 0.8
    # Of the rectangle 2 level x stroke a triangle is missing at each end.
    missing = level * 2 * level / (8e5 * (1 + a)) + level * 2 * level / (8e5 * (1 - a))
    assert work(x, f) == pytest.approx(2 * level * 8e-6 - missing, rel=2e-3)


def test_asymmetric_ratcheting_ends_at_the_level_in_a_closed_dissipating_loop():
    one = MaxwellSlip([(8e5, 1e-6)])
    x = np.tile(np.concatenate([path(4e-7), path(-4e-7) + 4e-7]), 60)
    f = force(x, effect("asymmetric-friction", asymmetry=0.2), model=one)
    assert np.max(np.abs(f)) <= 0.8 * (1 + 1e-12)
    cycle = len(x) // 60
    assert f[-1] == pytest.approx(f[-1 - cycle], abs=1e-9)
    assert work(x[-cycle - 1 :], f[-cycle - 1 :]) > 0.0


def test_noise_within_the_grain_does_not_ratchet():
    random = np.random.default_rng(0)
    x = 1e-6 + np.clip(15e-9 * random.standard_normal(20_000), -4e-8, 4e-8)
    one = effect("asymmetric-friction", asymmetry=0.2)
    still = force(x)
    assert np.max(np.abs(force(x, one, grain=5e-8) - still)[100:]) < 0.1 * BANK.level
    assert np.max(np.abs(force(x, one, grain=0.0) - still)) > 0.5 * BANK.level


# non-congruent-friction


@settings(max_examples=25, deadline=None)
@given(
    corners=st.lists(st.floats(-6e-6, 6e-6), min_size=1, max_size=6),
    bent=st.one_of(
        st.tuples(st.just("force"), st.floats(-0.9, 0.9)),
        st.tuples(st.just("elements"), st.floats(-0.9, 9.0)),
    ),
    inner=st.floats(0.05, 0.95),
)
def test_bent_loops_close_and_dissipate(corners, bent, inner):
    form, softening = bent
    bend = effect("non-congruent-friction", form=form, softening=softening)
    start = path(8e-6, *corners, -9e-6, step=5e-8)
    outer = start[-1] + inner * 8e-6
    x = np.concatenate(
        [start, np.linspace(start[-1], outer, 200)[1:], np.linspace(outer, start[-1], 200)[1:]]
    )
    f = force(x, bend)
    closed = slice(len(start) - 1, len(x))
    assert f[-1] == pytest.approx(f[len(start) - 1], abs=1e-9)
    assert work(x[closed], f[closed]) >= -1e-12
    if softening <= 1.0:
        assert np.max(np.abs(f)) <= BANK.level * (1 + 1e-12)


def test_only_elements_may_be_softer_than_level_where_they_yield():
    with pytest.raises(ConfigError, match=r"softening is 2 1; allowed is \[-1, 1\]"):
        effect("non-congruent-friction", softening=2.0)
    assert effect("non-congruent-friction", form="elements", softening=2.0).values["softening"] == 2.0


def test_equal_reversals_at_different_force_have_different_loops_only_when_bent():
    def shape(*effects, centre):
        x = np.concatenate([path(2e-5, -2e-5, -2e-5 + centre), -2e-5 + centre - path(1e-6)])
        f = force(x, *effects)
        return f[-1] - f[-101]

    bend = effect("non-congruent-friction", softening=0.5)
    assert shape(centre=4e-6) == pytest.approx(shape(centre=2e-5), rel=1e-9)
    assert shape(bend, centre=2e-5) > 0.6 * shape(centre=2e-5) - 1.0
    assert abs(shape(bend, centre=2e-5)) < 0.8 * abs(shape(bend, centre=6e-6))


@pytest.mark.parametrize("name", MODELS)
def test_the_bend_is_its_law_on_every_model(name):
    model = at_one_level(name)
    level = 4.4 if name == "maxwell-slip" else 3.0
    x = path(3e-6, -4e-6, 2e-5, -1e-5)
    plain = force(x, model=model)
    bent = force(x, effect("non-congruent-friction", softening=0.4), model=model)
    expected = plain * (1 + 0.4 * (1 - np.minimum(np.abs(plain) / level, 1.0)))
    np.testing.assert_allclose(bent, expected, atol=1e-6)


# load-dependent-friction


@pytest.mark.parametrize("name", MODELS)
def test_the_level_grows_by_the_load_and_the_force_at_rest_does_not_follow_it(name):
    model = at_one_level(name)
    load = effect("load-dependent-friction", coefficient=0.05)
    x = np.linspace(0, 4e-4, 40_001)
    plain = force(x, model=model)[-1]
    assert force(x, load, model=model, drive=-20.0)[-1] == pytest.approx(plain + 1.0, rel=2e-3)
    rest = np.concatenate([path(2e-7), np.full(200, 2e-7)])
    growing = np.concatenate([np.full(len(rest) - 200, 5.0), np.linspace(5.0, 20.0, 200)])
    f = force(rest, load, model=model, drive=growing)
    assert np.ptp(f[-200:]) < 1e-6


def test_a_gear_is_loaded_from_its_other_side_too():
    model = at_one_level("maxwell-slip")
    x = np.linspace(0, 4e-4, 40_001)
    plain = force(x, model=model)[-1]
    both = effect("load-dependent-friction", coefficient=0.05, external=0.1)
    weight = effect("gravity", force=-30.0)
    assert force(x, weight, both, model=model, drive=20.0)[-1] == pytest.approx(plain + 4.0, rel=2e-3)
    assert force(x, both, model=model, drive=20.0)[-1] == pytest.approx(plain + 1.0, rel=2e-3)


def test_the_level_grows_by_the_square_of_the_load_over_it():
    model = at_one_level("maxwell-slip")
    x = np.linspace(0, 4e-4, 40_001)
    plain = force(x, model=model)[-1]
    square = effect("load-dependent-friction", form="quadratic", coefficient=0.05, external=0.1)
    grown = 0.05 * 20.0**2 / plain
    assert force(x, square, model=model, drive=-20.0)[-1] == pytest.approx(plain + grown, rel=2e-3)
    weight = effect("gravity", force=-20.0)
    both = force(x, weight, square, model=model, drive=20.0)[-1]
    assert both == pytest.approx(plain + 3.0 * grown, rel=2e-3)


# stiction-ageing


@pytest.mark.parametrize("seconds", [0.01, 0.1, 1.0, 100.0])
def test_ageing_is_logarithmic_in_the_time_at_rest(seconds):
    ageing = effect("stiction-ageing", growth=0.1, distance=1e-5)
    rows = motion_rows(np.zeros(1000), seconds / 1000)
    reach = over_rows([ageing], rows)[-1, REACH]
    assert reach == pytest.approx(1 + 0.1 * math.log(1 + seconds / FRESH), rel=1e-9)


@settings(max_examples=20, deadline=None)
@given(speed=st.floats(1e-7, 1e-1), pieces=st.integers(1, 50))
def test_sliding_settles_at_distance_over_speed_however_it_is_stepped(speed, pieces):
    ageing = effect("stiction-ageing", growth=0.1, distance=1e-5)
    seconds = 30 * 1e-5 / speed
    x = speed * seconds * np.arange(1, pieces + 1) / pieces
    reach = over_rows([ageing], motion_rows(x, seconds / pieces))[-1, REACH]
    assert reach == pytest.approx(1 + 0.1 * math.log(1 + 1e-5 / speed / FRESH), rel=1e-6)


# friction-drift, frictional-lag, asymmetric-viscous-friction


def test_drift_is_its_curve():
    rows = motion_rows(np.zeros(500), 0.01)
    scale = over_rows([effect("friction-drift", change=-0.3, time_constant=1.2)], rows)[:, SCALE]
    t = 0.01 * np.arange(1, 501)
    np.testing.assert_allclose(scale, 1 - 0.3 * (1 - np.exp(-t / 1.2)), rtol=1e-12)


@pytest.mark.parametrize("pieces", [1, 7, 1000])
def test_the_lag_of_viscous_friction_is_exact_for_a_speed_that_grows_evenly(pieces):
    tau, seconds, slope = 0.02, 0.05, 3.0
    rows = motion_rows(np.zeros(pieces), seconds / pieces)
    t = seconds * np.arange(1, pieces + 1) / pieces
    rows[:, VELOCITY] = slope * t
    late = chain(effect("frictional-lag", time_constant=tau), model=effect("viscous-friction", coefficient=8))
    expected = 8.0 * slope * (t - tau * (1 - np.exp(-t / tau)))
    np.testing.assert_allclose(over_rows(late, rows)[:, FRICTION], expected, rtol=1e-9)


@pytest.mark.parametrize("name", ["lugre", "gms", "leuven", "modified-leuven", "stribeck"])
def test_every_level_that_falls_with_speed_falls_late(name):
    if name == "stribeck":
        effects, model = [effect("stribeck", rise=0.5, velocity=2e-3)], BANK
    else:
        effects, model = [], physics.entry(name).from_dict({**physics.entry(name).example, "viscous": 0.0})
    speed = np.where(np.arange(4000) < 2000, 2e-4, 2e-2)
    x = np.cumsum(speed) * 1e-3
    lag = effect("frictional-lag", time_constant=0.1)
    prompt, late = force(x, *effects, model=model), force(x, lag, *effects, model=model)
    assert late[2010] > prompt[2010] + 0.1  # still at the level of slow motion
    assert late[-1] == pytest.approx(prompt[-1], rel=0.02)


@pytest.mark.parametrize("name", ["lugre", "gms", "leuven", "modified-leuven", "viscous-friction"])
def test_viscous_friction_by_direction(name):
    example = physics.entry(name).example
    model = physics.entry(name).from_dict({**example, **({"viscous": 5.0} if "viscous" in example else {})})
    coefficient = example.get("viscous", example.get("coefficient"))
    skew = effect("asymmetric-viscous-friction", ratio=0.3)
    for sign in (1.0, -1.0):
        x = sign * 0.1e-3 * np.arange(1, 2000)
        difference = force(x, skew, model=model)[-1] - force(x, model=model)[-1]
        assert difference == pytest.approx(0.3 * coefficient * 0.1)


# creep


def test_held_contacts_relax_by_the_closed_form_and_stay_in_series_with_the_creep():
    """At held position a Kelvin-Voigt body in series with k relaxes F to F / (1 + fraction)."""
    one, fraction, tau = MaxwellSlip([(8e5, 1e-5)]), 0.5, 0.3
    x = np.concatenate([[2e-6], np.full(4000, 2e-6)])
    f = force(x, effect("creep", fraction=fraction, time_constant=tau), model=one, step=1e-3)
    t = 1e-3 * np.arange(len(x))
    rate = (1 + fraction) / tau
    expected = 1.6 * (1 - fraction / (1 + fraction) * (1 - np.exp(-rate * t)))
    np.testing.assert_allclose(f[50:], expected[50:], rtol=3e-3)


@pytest.mark.parametrize("name", MODELS)
def test_creep_leaves_sliding_alone(name):
    entry = physics.entry(name)
    model = entry.from_dict(dict(entry.example))
    x = 1e-6 * np.arange(1, 3000)
    assert force(x, effect("creep", fraction=0.5, time_constant=0.1), model=model)[-1] == pytest.approx(
        force(x, model=model)[-1], rel=1e-3
    )
