"""The prior: non-negative, non-increasing, and the nearest such weights; checked by trying every case."""

from __future__ import annotations

from itertools import product

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.hysteresis.prior import non_increasing

seeds = st.integers(0, 100_000)


def information(rng, n):
    root = rng.normal(0.0, 1.0, (n + 3, n))
    return root.T @ root + 0.05 * np.eye(n)


def brute_force(w, a, free):
    """The quadratic programme by its active sets: each step down either free or zero, the best that fits."""
    n = w.size - free
    steps = np.eye(w.size)
    steps[:n, :n] = np.triu(np.ones((n, n)))
    best, cost = None, np.inf
    for mask in product([False, True], repeat=n):
        columns = steps[:, [*mask, *[True] * free]]
        d = np.linalg.lstsq(columns.T @ a @ columns, columns.T @ a @ w, rcond=None)[0]
        if (d[: sum(mask)] < -1e-12).any():
            continue
        v = columns @ d
        if (v - w) @ a @ (v - w) < cost:
            best, cost = v, (v - w) @ a @ (v - w)
    return best


@settings(max_examples=60, deadline=None)
@given(seeds, st.integers(1, 6), st.integers(0, 1), st.sampled_from([1.0, 1e5]))
def test_nearest_of_all_that_are_allowed(seed, n, free, scale):
    rng = np.random.default_rng(seed)
    w = scale * rng.normal(0.5, 1.0, n + free)
    a = information(rng, n + free)
    found = non_increasing(w, a, free)
    kept = found[:n]
    assert (kept >= -1e-9 * scale).all() and (np.diff(kept) <= 1e-9 * scale).all()
    assert np.allclose(found, brute_force(w, a, free), rtol=0, atol=1e-6 * scale)


@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(1, 20), st.integers(0, 1), st.booleans())
def test_what_is_so_already_stays(seed, n, free, ties):
    rng = np.random.default_rng(seed)
    w = np.sort(rng.uniform(0.0, 5e5, n))[::-1]
    if ties:
        w = np.floor(w / 2e5) * 2e5
    w = np.concatenate([w, rng.normal(0.0, 1.0, free)])
    widths = np.append(rng.uniform(1e-6, 5e-6, n), [3e-6] * free)
    a = information(rng, n + free) * np.outer(widths, widths)
    assert np.array_equal(non_increasing(w, a, free), w)


def test_the_offset_is_free_to_be_negative():
    found = non_increasing(np.array([2.0, 3.0, -7.0]), np.eye(3), free=1)
    assert np.allclose(found, [2.5, 2.5, -7.0])


def test_noise_shrinks():
    """Around a curve that is so, the prior removes noise; it never adds."""
    rng = np.random.default_rng(1)
    truth = np.linspace(5.0, 0.0, 12)
    noisy = truth + rng.normal(0.0, 1.0, (50, 12))
    kept = np.array([non_increasing(w, np.eye(12)) for w in noisy])
    before, after = np.linalg.norm(noisy - truth, axis=1), np.linalg.norm(kept - truth, axis=1)
    assert (after <= before + 1e-9).all() and after.mean() < 0.8 * before.mean()
