"""Weights that vary smoothly: the correlation that a learner begins with, and what comes of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.learner import learn
from rtcomp.hysteresis.rls import Rls
from rtcomp.hysteresis.shaped import PARTS, ShapedIntervalBasis
from rtcomp.hysteresis.smoothness import correlation

widths = st.lists(st.floats(0.02, 1.0), min_size=1, max_size=8)


def smooth(length, count=10, **more):
    return ShapedIntervalBasis.over(count, 2.0, smooth=length, groups=count, **more)


@settings(max_examples=60, deadline=None)
@given(
    widths, st.lists(st.sampled_from(PARTS), unique=True), st.sampled_from([3, 5, 9]), st.floats(0.05, 10.0)
)
def test_it_is_a_correlation_whatever_the_parts(a, parts, places, length):
    found = ShapedIntervalBasis(a, parts, places, smooth=length).likeness()
    assert np.allclose(np.diag(found), 1.0, rtol=0, atol=1e-9)
    assert np.array_equal(found, found.T)
    assert np.linalg.eigvalsh(found).min() > 0.0


def test_values_of_the_process_and_differences_of_them_as_the_closed_form_has_them():
    far, near = np.exp(-0.5 * 0.3**2), np.exp(-0.5 * 0.1**2)
    found = correlation([[[(0.0, 0.0, 1.0)], [(0.3, 0.0, 1.0)]], [[(0.0, 0.1, 1.0), (0.0, 0.0, -1.0)]]], 1.0)
    assert found[0, 1] == pytest.approx(far, rel=1e-5)
    assert found[2, :2] == pytest.approx([0.0, 0.0])
    one = correlation([[[(0.0, 0.0, 1.0)], [(0.0, 0.1, 1.0), (0.0, 0.0, -1.0)]]], 1.0)
    assert one[0, 1] == pytest.approx((near - 1.0) / np.sqrt(2.0 - 2.0 * near), rel=1e-5)


@pytest.mark.parametrize("parts", [(), ("position",), ("reversible", "position"), PARTS])
def test_neighbours_are_alike_and_regressors_keep_their_order(parts):
    """Of each kind the next one is more alike than the last, and kinds with nothing in common are apart."""
    basis = smooth(0.5, parts=parts, places=9)
    found = basis.likeness()
    assert found.shape == (basis.size, basis.size)
    assert (np.diff(found[0, :10]) < 0.0).all()
    if "reversible" in parts:
        curve = found[10:18, 10:18]
        assert curve[4, 5] > curve[4, 7] > curve[4, 0]
        assert not found[:10, 10:18].any() and not found[18:, 10:18].any()
    if "output" in parts:
        assert np.allclose(found[-2:, :-2], 0.0) and abs(found[-1, -2]) < 1e-12


def test_without_a_length_each_is_on_its_own():
    basis = smooth(0.0)
    assert basis.likeness() is None
    scales = basis.scales()
    state = Rls().initial_state(scales)
    assert np.allclose(smooth(1e-3).likeness()[:10, :10], np.eye(10), atol=1e-9)
    assert np.array_equal(state[: scales.size**2], np.diag((Rls().trust / scales) ** 2).ravel())


def test_what_is_not_in_the_likeness_is_on_its_own():
    scales, rls = np.array([1.0, 2.0, 0.5]), Rls(trust=10.0)
    covariance = rls.initial_state(scales, np.array([[1.0, 0.5], [0.5, 1.0]]))[:9].reshape(3, 3)
    assert covariance == pytest.approx(np.array([[100.0, 25.0, 0.0], [25.0, 25.0, 0.0], [0.0, 0.0, 400.0]]))


def test_loops_between_those_that_were_seen_are_foreseen_better():
    """Two loops and noise tell of a third that neither ran, where weights in fact vary smoothly."""
    turn = np.concatenate([np.linspace(0, 1, 50), np.linspace(1, -1, 100), np.linspace(-1, 0, 50)])
    seen = np.concatenate([0.3 * turn, 0.3 * turn, 0.95 * turn, 0.95 * turn])
    other = np.tile(0.6 * turn, 2)
    rng = np.random.default_rng(1)
    errors = {}
    for length in (0.0, 1.0):
        basis = smooth(length, parts=("reversible", "position"), places=7)
        likely = np.linalg.cholesky(smooth(1.0, parts=basis.parts, places=7).likeness())
        truth = likely @ np.random.default_rng(4).normal(size=basis.size) / basis.scales()
        force = regressors(basis, seen) @ truth
        noisy = force + rng.normal(0.0, 0.01 * np.abs(force).max(), force.size)
        w = learn(basis, Rls(1.0), seen, noisy)
        missed = regressors(basis, other) @ (w - truth)
        errors[length] = np.sqrt(np.mean(missed**2)) / np.abs(regressors(basis, other) @ truth).max()
    assert errors[1.0] < 0.02 and errors[1.0] < 0.5 * errors[0.0]


def test_rough_weights_are_learned_all_the_same_from_enough_motion():
    basis = smooth(0.5, parts=("position",), places=5)
    truth = np.random.default_rng(2).normal(size=basis.size) / basis.scales()
    x = regressors(basis, random_strokes(4000, 9))
    missed = []
    for samples in (1_000, 10_000, 100_000):
        u = random_strokes(samples, 3)
        w = learn(basis, Rls(1.0), u, regressors(basis, u) @ truth)
        missed.append(np.sqrt(np.mean((x @ (w - truth)) ** 2)) / np.abs(x @ truth).max())
    assert missed[2] < 0.02 < missed[0]
    assert missed[2] < 0.3 * missed[1]


def random_strokes(samples, seed):
    """Strokes of ten samples each between random turns, within the range."""
    turns = np.random.default_rng(seed).uniform(-1.0, 1.0, samples // 10 + 1)
    turns[0] = 0.0
    return np.interp(np.arange(samples) / 10.0, np.arange(turns.size), turns)
