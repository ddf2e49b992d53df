"""The quadratic minimum within bounds, against scipy's."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear, nnls

from rtcomp.diagnosis.numerics.bounded import bounded_minimum


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_it_is_the_best_within_the_bounds(seed: int) -> None:
    random = np.random.default_rng(seed)
    a = random.normal(size=(240, 6)) @ random.normal(size=(6, 6))
    y = a @ random.normal(size=6) + 0.3 * random.normal(size=240)
    low = random.normal(size=6) - 1.0
    high = low + random.uniform(0.1, 2.0, 6)
    ours = np.asarray(bounded_minimum(a.T @ a, a.T @ y, low, high))
    best = lsq_linear(a, y, bounds=(low, high), tol=1e-14).x
    assert np.all(ours >= low - 1e-9) and np.all(ours <= high + 1e-9)
    assert np.sum((y - a @ ours) ** 2) <= np.sum((y - a @ best) ** 2) * (1 + 1e-6)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_it_is_the_best_where_columns_are_almost_alike(seed: int) -> None:
    """As those of friction units that yield within a few rows of a reversal."""
    random = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, 2000)
    reaches = np.geomspace(1e-7, 2e-2, 40)
    units = np.array([np.tanh((t % 0.25 - 0.05) / reach) for reach in reaches])
    y = units.T @ (20.0 * random.random(40) * (random.random(40) < 0.1)) + 0.3 * random.normal(size=t.size)
    gram = units @ units.T + 1e-9 * t.size * np.eye(40)
    ours = np.asarray(bounded_minimum(gram, units @ y, np.zeros(40), np.full(40, np.inf)))
    best = nnls(units.T, y)[0]
    assert np.all(ours >= 0.0)
    assert np.sum((y - ours @ units) ** 2) <= np.sum((y - best @ units) ** 2) * (1 + 1e-4)
