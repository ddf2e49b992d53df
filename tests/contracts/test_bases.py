"""What every hysteresis basis must do; runs on each that is registered, a third party's included."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rtcomp.hysteresis
from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import bases, basis_named, regressors

inputs = st.lists(st.floats(-0.9, 0.9), min_size=1, max_size=40).map(lambda a: np.array([0.0, *a]))


def examples():
    """Every registered basis, spread over the same range, small and larger."""
    return [
        pytest.param(kind.over(count, 2.0), id=f"{name}-{count}")
        for name, kind in sorted(bases().items())
        for count in (1, 12)
    ]


every = pytest.mark.parametrize("basis", examples())


def test_the_operators_of_the_paper_are_there():
    assert {"interval", "stop", "extended-stop", "preisach"} <= set(bases())
    assert rtcomp.hysteresis.bases is bases
    with pytest.raises(ConfigError, match="did you mean 'interval'"):
        basis_named("intervall")


@every
def test_vectors_have_the_sizes_they_promise(basis):
    assert basis.size >= 1
    assert basis.scales().shape == (basis.size,) and (basis.scales() > 0).all()
    assert basis.vector().dtype == basis.initial_state().dtype == np.float64
    assert np.isfinite(basis.vector()).all() and np.isfinite(basis.initial_state()).all()


@every
def test_the_first_input_only_sets_the_starting_point(basis):
    out = regressors(basis, np.array([0.4, 0.4, 0.5]))
    assert not out[:2].any() and out[2].any()


@every
def test_dictionary_round_trip(basis):
    entry = basis.to_dict()
    assert entry.pop("model") == basis.name
    again = type(basis).from_dict(entry)
    assert again.to_dict() == basis.to_dict()
    assert np.array_equal(again.vector(), basis.vector())
    with pytest.raises(ConfigError) as caught:
        type(basis).from_dict({"nonsense": 1.0})
    assert "\n" not in str(caught.value) and basis.name in str(caught.value)


@every
@settings(max_examples=20, deadline=None)
@given(u=inputs)
def test_python_and_compiled_agree(basis, u):
    p, s, x = basis.vector(), basis.initial_state(), np.zeros(basis.size)
    compiled = regressors(basis, u)
    for k, value in enumerate(u):
        basis.kernel.python(p, s, x, value)
        assert np.allclose(x, compiled[k], rtol=0, atol=1e-14)


@every
@settings(max_examples=20, deadline=None)
@given(u=inputs, seed=st.integers(0, 1000))
def test_rate_does_not_matter(basis, u, seed):
    """Only the sequence of extremes counts: any number of samples on the way, and rests, change nothing."""
    rng = np.random.default_rng(seed)
    fine = [u[:1]]
    for a, b in pairwise(u):
        inner = np.sort(rng.uniform(0.0, 1.0, rng.integers(0, 4)))
        fine += [a + (b - a) * inner, np.full(rng.integers(1, 3), b)]
    slow = regressors(basis, np.concatenate(fine))[-1]
    assert np.allclose(slow, regressors(basis, u)[-1], rtol=0, atol=1e-12)


@every
@settings(max_examples=20, deadline=None)
@given(u=inputs)
def test_regressors_are_bounded_continuous_and_finite(basis, u):
    out = regressors(basis, u)
    assert np.isfinite(out).all()
    within = 2.0 * np.maximum(basis.scales(), 0.0) + 1e-12
    assert (np.abs(out) <= np.maximum(within, np.abs(u - u[0]).max())).all()
    steps = np.abs(np.diff(u))
    assert (np.abs(np.diff(out, axis=0)).max(axis=1) <= 2.0 * steps * max(basis.size, 1) + 1e-12).all()


@every
@settings(max_examples=20, deadline=None)
@given(u=inputs, outside=st.floats(0.91, 1.0))
def test_wiping_out(basis, u, outside):
    turn = np.array([outside, -outside, 0.2])
    after = regressors(basis, np.concatenate([u, turn]))[-2:]
    assert np.allclose(after, regressors(basis, np.concatenate([[0.0], turn]))[-2:], rtol=0, atol=1e-12)


@every
def test_memory_is_bounded_and_a_long_run_stays_exact(basis):
    u = np.random.default_rng(1).normal(0.0, 0.02, 50_000).cumsum()
    u = 0.9 * np.sin(u - u[0])
    state = basis.initial_state()
    before = state.size
    out = regressors(basis, np.concatenate([u, [1.0, -1.0]]), state)
    assert state.size == before and np.isfinite(state).all()
    assert np.allclose(out[-1], regressors(basis, np.array([0.0, 1.0, -1.0]))[-1], rtol=0, atol=1e-11)
