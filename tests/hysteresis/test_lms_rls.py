"""The learners against their equations: (8) as printed, least squares in closed form, no wind-up."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError
from rtcomp.hysteresis import build_learner, learn, regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.lms import Lms, Nlms
from rtcomp.hysteresis.rls import Rls

seeds = st.integers(0, 10_000)


def motion(seed, samples=400):
    return np.sin(np.random.default_rng(seed).normal(0.0, 0.2, samples).cumsum())


def some_data(seed, count=5, samples=400):
    rng = np.random.default_rng(seed)
    basis = IntervalBasis(rng.uniform(0.1, 0.6, count))
    u = motion(seed, samples)
    x = regressors(basis, u)
    return basis, u, x, x @ rng.uniform(1.0, 5.0, count) + rng.normal(0.0, 0.05, samples)


@settings(max_examples=30, deadline=None)
@given(seeds, st.floats(0.001, 1.9))
def test_lms_is_equation_8(seed, step):
    basis, u, x, measured = some_data(seed)
    mu = step / np.sum((basis.widths / 2) ** 2)
    w = np.zeros(basis.size)
    for k in range(u.size):
        error = measured[k] - w @ x[k]  # (7)
        w = w + mu * error * x[k]  # (8)
    assert np.allclose(learn(basis, Lms(step), u, measured), w, rtol=1e-9, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(seeds, st.floats(0.001, 1.9))
def test_nlms_divides_by_the_squared_norm(seed, step):
    basis, u, x, measured = some_data(seed)
    floor = 1e-4 * np.sum((basis.widths / 2) ** 2)
    w = np.zeros(basis.size)
    for k in range(u.size):
        w = w + step * (measured[k] - w @ x[k]) * x[k] / (x[k] @ x[k] + floor)
    assert np.allclose(learn(basis, Nlms(step), u, measured), w, rtol=1e-9, atol=1e-9)


def test_nlms_pace_does_not_depend_on_amplitude():
    """One update removes the share `step` of the error, whatever the size of the regressors."""
    learner = Nlms(0.25)
    for size in (1.0, 1e-6):
        scales = np.full(3, size)
        w = np.zeros(3)
        x = size * np.array([1.0, -0.5, 0.3])
        learner.kernel(learner.vector(scales), learner.initial_state(scales), x, w, 4.0)
        assert w @ x == pytest.approx(1.0, rel=1e-3)


@settings(max_examples=30, deadline=None)
@given(seeds, st.floats(1.0, 1e4))
def test_rls_without_forgetting_is_least_squares(seed, trust):
    """In closed form: the batch solution with the start as a prior, (X'X + P0^-1)^-1 X'y."""
    basis, u, x, measured = some_data(seed)
    prior = np.diag((basis.scales() / trust) ** 2)
    batch = np.linalg.solve(x.T @ x + prior, x.T @ measured)
    assert np.allclose(learn(basis, Rls(1.0, trust), u, measured), batch, rtol=1e-6, atol=1e-7)


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_rls_covariance_is_the_inverse_of_the_information(seed):
    basis, _, x, _ = some_data(seed)
    learner, scales = Rls(1.0, 50.0), basis.scales()
    p, s, w = learner.vector(scales), learner.initial_state(scales), np.zeros(basis.size)
    for row in np.ascontiguousarray(x):
        learner.kernel(p, s, row, w, 0.0)
    expected = x.T @ x + np.diag((scales / 50.0) ** 2)
    assert np.allclose(learner.information(s, scales), expected, rtol=1e-6, atol=1e-9 * expected.max())


def test_rls_with_forgetting_weighs_the_past_less():
    """As long as no variance comes near its cap it is exponentially weighted least squares."""
    basis, u, x, measured = some_data(3, samples=3000)
    forgetting, trust = 0.995, 1e4
    age = np.arange(u.size)[::-1]
    weight = forgetting**age
    gram, cross = x.T @ (weight[:, None] * x), x.T @ (weight * measured)
    weighted = np.linalg.solve(gram, cross)
    assert np.allclose(learn(basis, Rls(forgetting, trust), u, measured), weighted, rtol=1e-4)
    plain = np.linalg.lstsq(x, measured, rcond=None)[0]
    assert not np.allclose(weighted, plain, rtol=1e-4)


def test_rls_follows_a_change():
    basis = IntervalBasis.over(5, 1.5)
    u = motion(4, 20_000)
    x = regressors(basis, u)
    before, after = np.linspace(5.0, 1.0, 5), np.linspace(2.0, 1.5, 5)
    force = np.where(np.arange(u.size) < 10_000, x @ before, x @ after)
    assert np.allclose(learn(basis, Rls(0.995), u, force), after, rtol=1e-3)
    assert not np.allclose(learn(basis, Rls(1.0), u, force), after, rtol=0.05)


@pytest.mark.parametrize("forgetting", [0.9, 0.99, 0.9999])
@pytest.mark.parametrize("excited", ["nothing", "one direction"])
def test_rls_does_not_wind_up(forgetting, excited):
    """100,000 updates that say nothing new: covariance within its caps, weights where they were."""
    learner, scales = Rls(forgetting), np.array([1e-6, 2e-6, 5e-6, 1e-5])
    p, s = learner.vector(scales), learner.initial_state(scales)
    w = np.array([4e5, 3e5, 2e5, 1e5])
    rng = np.random.default_rng(0)
    for _ in range(500):
        x = rng.uniform(-1.0, 1.0, 4) * scales
        learner.kernel(p, s, x, w, 0.0)
    learned = w.copy()
    x = np.zeros(4) if excited == "nothing" else scales * np.array([1.0, 1.0, 0.3, -0.2])
    rounds = 100_000
    from rtcomp.kernels import call_learner, compiled

    @compiled
    def repeat(address, p, s, x, w, error, rounds):
        for _ in range(rounds):
            call_learner(address, p.ctypes.data, s.ctypes.data, x.ctypes.data, w.ctypes.data, error)

    repeat(learner.kernel.address, p, s, x, w, 0.0 if x.any() else 1.0, rounds)
    covariance = s[:16].reshape(4, 4)
    caps = p[2:-2]
    assert (np.diag(covariance) <= caps * (1 + 1e-9)).all() and (np.diag(covariance) > 0).all()
    normal = covariance / np.sqrt(np.outer(caps, caps))
    assert np.allclose(normal, normal.T) and np.linalg.eigvalsh(normal).min() > -1e-12
    assert np.array_equal(w, learned)
    # One sample of noise after the pause must not throw the weights about.
    learner.kernel(p, s, rng.uniform(-1.0, 1.0, 4) * scales, w, 1e-3)
    assert np.abs((w - learned) * scales).max() < 0.01


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ({"learner": "lms", "step": 0.0}, "step is 0"),
        ({"learner": "lms", "step": 2.0}, "below 2"),
        ({"learner": "nlms", "step": float("nan")}, "step is nan"),
        ({"learner": "rls", "forgetting": 1.01}, "0.9 to 1"),
        ({"learner": "rls", "forgetting": 0.5}, "forgetting is 0.5"),
        ({"learner": "rls", "trust": -1.0}, "trust is -1"),
    ],
)
def test_settings_without_sense_are_refused_in_one_line(entry, says):
    with pytest.raises(ConfigError, match=says) as caught:
        build_learner(entry)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "entry",
    [
        {"learner": "lms", "step": "fast"},
        {"learner": "rls", "forgetting": None},
        {"learner": "rls", "trust": [1.0]},
        {"learner": ["rls"]},
    ],
)
def test_settings_of_the_wrong_type_are_refused_too(entry):
    with pytest.raises(ConfigError) as caught:
        build_learner(entry)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("change", [0.3, -0.3])
def test_friction_that_drifts_as_a_whole_is_followed(change):
    """30 % within 10,000 updates: with `drift` the weights stay where the friction is, without they lag."""
    basis = IntervalBasis.over(12, 1.0)
    true = np.linspace(5.0, 0.5, 12)
    time = np.arange(20_000) / 1000.0
    u = 0.6 * (0.2 + 0.8 * np.abs(np.sin(0.8 * time))) * np.sin(2 * np.pi * time)
    level = 1.0 + change * np.clip((time - 10.0) / 10.0, 0.0, 1.0)
    noise = 0.01 * np.random.default_rng(0).standard_normal(time.size)
    force = regressors(basis, u) @ true * level + noise
    off = {}
    for drift in (0.0, 1e-4):
        w = learn(basis, Rls(0.9995, drift=drift), u, force)
        off[drift] = np.linalg.norm(w / (1.0 + change) - true) / np.linalg.norm(true)
    assert off[1e-4] < 0.03 and off[1e-4] < 0.3 * off[0.0]


def test_drift_adds_nothing_where_nothing_is_excited():
    """Along the weights the variance would grow without end: it stops at its cap, as forgetting does."""
    learner, scales = Rls(0.9995, drift=0.01), np.ones(5)
    p, s, w = learner.vector(scales), learner.initial_state(scales), np.full(5, 3.0)
    draw = np.random.default_rng(0)
    for _ in range(300):
        learner.kernel(p, s, draw.uniform(-1.0, 1.0, 5), w, 0.1 * draw.standard_normal())
    before = w.copy()
    for _ in range(20_000):
        learner.kernel(p, s, np.zeros(5), w, 1.0)
    covariance = s[:25].reshape(5, 5)
    assert (np.diag(covariance) <= p[2:-2] * (1 + 1e-9)).all() and np.array_equal(covariance, covariance.T)
    assert np.array_equal(w, before) and (np.linalg.eigvalsh(covariance) > 0).all()


@pytest.mark.parametrize("drift", [-1e-9, 0.2, np.nan])
def test_drift_has_a_range(drift):
    with pytest.raises(ConfigError, match=r"drift is .*; allowed is 0 to 0\.1"):
        Rls(drift=drift)
