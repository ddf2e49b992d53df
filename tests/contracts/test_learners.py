"""What every learner must do on every basis; runs on each that is registered."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError
from rtcomp.hysteresis import bases, build_learner, learn, learners, regressors

COUNT, RANGE = 6, 1.0
BASES = {name: kind.over(COUNT, RANGE) for name, kind in sorted(bases().items())}
LEARNERS = {name: kind() for name, kind in sorted(learners().items())}
every_learner = pytest.mark.parametrize("learner", LEARNERS.values(), ids=LEARNERS.keys())
every_pair = pytest.mark.parametrize(
    ("basis", "learner"),
    [pytest.param(b, k, id=f"{n}-{m}") for n, b in BASES.items() for m, k in LEARNERS.items()],
)


def motion(seed: int, samples: int):
    """A random walk through the whole range, at most half of it to either side."""
    u = np.random.default_rng(seed).normal(0.0, 0.05, samples).cumsum()
    return 0.5 * RANGE * np.sin(u - u[0])


def truth(basis):
    return (1.0 + np.arange(basis.size) % 3) / basis.scales() * basis.scales().mean()


def held_out(basis, w):
    x = regressors(basis, motion(99, 3000))
    wanted = x @ truth(basis)
    return np.sqrt(np.mean((wanted - x @ w) ** 2)) / np.abs(wanted).max()


def test_the_learners_of_the_paper_are_there():
    assert {"lms", "nlms", "rls", "gradient"} <= set(LEARNERS)
    with pytest.raises(ConfigError, match="did you mean 'gradient'"):
        build_learner({"learner": "gradiant"})


@every_learner
def test_dictionary_round_trip(learner):
    again = build_learner(learner.to_dict())
    assert again.to_dict() == learner.to_dict() and type(again) is type(learner)
    with pytest.raises(ConfigError) as caught:
        build_learner({**learner.to_dict(), "nonsense": 1.0})
    assert "\n" not in str(caught.value) and learner.name in str(caught.value)


@every_pair
def test_learns_a_truth_that_it_can_express_and_keeps_it_on_other_motion(basis, learner):
    u = motion(1, 30_000)
    force = regressors(basis, u) @ truth(basis)
    w = learn(basis, learner, u, force, gate=0.002)
    assert np.isfinite(w).all()
    assert held_out(basis, np.zeros(basis.size)) > 0.2
    assert held_out(basis, w) < (0.002 if learner.name == "rls" else 0.02)


@every_pair
def test_right_weights_stay(basis, learner):
    u = motion(2, 3000)
    w = truth(basis)
    after = learn(basis, learner, u, regressors(basis, u) @ w, weights=w)
    assert np.allclose(after, w, rtol=1e-9)


@every_pair
def test_frozen_when_told_and_at_rest(basis, learner):
    w = truth(basis)
    u = motion(3, 500)
    wrong = np.random.default_rng(0).normal(0.0, 10.0, u.size)
    assert np.array_equal(learn(basis, learner, u, wrong, gate=np.inf, weights=w), w)
    still = np.concatenate([np.linspace(0.0, 0.3, 50), np.full(2000, 0.3)])
    moving = learn(basis, learner, still[:50], np.zeros(50), gate=0.002, weights=w)
    rested = learn(basis, learner, still, np.concatenate([np.zeros(50), wrong[:1].repeat(2000)]), 0.002, w)
    assert np.array_equal(moving, rested)


@every_pair
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 1000), size=st.sampled_from([1e-9, 1e-3, 1.0, 1e6]))
def test_no_nan_whatever_the_force(basis, learner, seed, size):
    u = motion(seed, 400)
    force = size * np.random.default_rng(seed).standard_cauchy(u.size)
    assert np.isfinite(learn(basis, learner, u, force)).all()


@every_pair
def test_no_wind_up_when_hardly_excited(basis, learner):
    """An hour of tiny motion with noise, then real motion: the weights are still useful and finite."""
    rng = np.random.default_rng(5)
    u = motion(1, 10_000)
    tiny = u[-1] + 1e-3 * RANGE * np.sin(np.arange(40_000) * 0.05)
    both = np.concatenate([u, tiny])
    force = regressors(basis, both) @ truth(basis) + rng.normal(0.0, 1e-3, both.size)
    w = learn(basis, learner, both, force)
    assert np.isfinite(w).all()
    assert held_out(basis, w) < 0.5


@every_pair
def test_python_and_compiled_agree(basis, learner):
    u = motion(4, 60)
    x = regressors(basis, u)
    force = x @ truth(basis)
    p, scales = learner.vector(basis.scales()), basis.scales()
    s1, s2 = learner.initial_state(scales), learner.initial_state(scales)
    w1, w2 = np.zeros(basis.size), np.zeros(basis.size)
    for k in range(u.size):
        row = np.ascontiguousarray(x[k])
        learner.kernel(p, s1, row, w1, force[k] - row @ w1)
        learner.kernel.python(p, s2, row, w2, force[k] - row @ w2)
    assert w1.any()
    assert np.allclose(w1, w2, rtol=1e-6, atol=1e-9 * np.abs(w1).max())
