"""The interval operator with shape: what it shares with the plain one, and what it must not lose."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.preisach import PreisachBasis
from rtcomp.hysteresis.shaped import PARTS, ShapedIntervalBasis, integral
from rtcomp.hysteresis.skew import as_skewed
from rtcomp.kernels import call_basis, compiled

inputs = st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=40).map(lambda a: np.array([0.0, *a]))
widths = st.lists(st.floats(0.02, 1.0), min_size=1, max_size=8)
CHOICES = [c for n in range(4) for c in combinations(PARTS, n)]
FULL = ShapedIntervalBasis.over(20, 2.0, 4.0)


def some_weights(basis, seed):
    return np.random.default_rng(seed).normal(0.0, 1.0, basis.size) / basis.scales()


@settings(max_examples=60, deadline=None)
@given(widths, inputs, st.sampled_from(CHOICES), st.sampled_from([3, 5, 9]))
def test_without_what_it_adds_it_is_the_symmetric_operator(a, u, parts, places):
    shaped = regressors(ShapedIntervalBasis(a, parts, places), u)
    assert np.allclose(shaped[:, : len(a)], regressors(IntervalBasis(a), u), rtol=0, atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(inputs, st.integers(0, 999), st.lists(st.floats(0.0, 1.0), min_size=2, max_size=12))
def test_the_same_state_gives_the_same_output_whatever_was_between(u, seed, between):
    """Loops close: after any excursion between the last two extremes, coming back there is coming back."""
    if u.size < 3 or u[-1] == u[-2]:
        return
    low, high = u[-2], u[-1]
    inside = low + (high - low) * np.array(between)
    out = regressors(FULL, np.concatenate([u, inside, [high]])) @ some_weights(FULL, seed)
    assert out[-1] == pytest.approx(out[u.size - 1], abs=1e-11 * FULL.size)


@compiled
def cycle(address, p, s, x, ends, cycles):
    for _ in range(cycles):
        for u in ends:
            call_basis(address, p.ctypes.data, s.ctypes.data, x.ctypes.data, u)


@pytest.mark.parametrize("ends", [(0.31, 0.29), (0.05, -0.07, 0.33, 0.3), (0.9, -0.95, 0.3)])
def test_a_minor_loop_does_not_drift_in_a_hundred_thousand_cycles(ends):
    basis = FULL
    p, s, x = basis.vector(), basis.initial_state(), np.zeros(basis.size)
    start = np.array([0.0, 0.8, -0.6, 0.5, ends[-1]])
    cycle(basis.kernel.address, p, s, x, start, 1)
    cycle(basis.kernel.address, p, s, x, np.array(ends), 1)
    before = x.copy()
    cycle(basis.kernel.address, p, s, x, np.array(ends), 100_000)
    assert np.allclose(x, before, rtol=0, atol=1e-10)


@pytest.mark.parametrize("skew", [0.2, -0.2])
def test_a_skewed_small_loop_ratchets_no_further_than_the_range_and_closes_then(skew):
    basis = ShapedIntervalBasis.over(10, 2.0, skew=skew)
    p, s, x = basis.vector(), basis.initial_state(), np.zeros(basis.size)
    ends = np.array([0.01, -0.01])
    cycle(basis.kernel.address, p, s, x, np.array([0.0, 0.0]), 1)
    once = x.copy()
    cycle(basis.kernel.address, p, s, x, ends, 1)
    assert not np.allclose(x, once, atol=1e-6)
    cycle(basis.kernel.address, p, s, x, ends, 2000)
    settled = x.copy()
    assert np.sign(skew) * settled[:10].sum() > 0.0
    assert (np.abs(settled[:10]) <= basis.scales()[:10] + 1e-12).all()
    cycle(basis.kernel.address, p, s, x, ends, 100_000)
    assert np.allclose(x, settled, rtol=0, atol=1e-10)


def test_a_skew_is_displacement_that_counts_more_in_one_direction():
    u = np.random.default_rng(3).normal(0.0, 0.2, 400).cumsum()
    step = np.diff(u)
    warped = np.concatenate([[0.0], np.cumsum(step * (1.0 + 0.1 * np.sign(step)))])
    skewed = ShapedIntervalBasis.over(6, 2.0, skew=0.1, parts=[])
    assert np.allclose(regressors(skewed, u), regressors(IntervalBasis.over(6, 2.0), warped), atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(widths, inputs, st.floats(-0.5, 0.5), st.floats(0.0, 0.01))
def test_the_symmetric_operator_on_the_motion_as_a_skewed_one_sees_it_is_that_one(a, u, skew, grain):
    basis = ShapedIntervalBasis(a, [], skew=skew, grain=grain)
    plain = regressors(IntervalBasis(a), as_skewed(u, skew, grain))
    assert np.allclose(regressors(basis, u), plain, rtol=0, atol=1e-12)


def test_noise_within_the_grain_does_not_ratchet():
    """A skewed operator that moves slowly in noise goes as without it."""
    rng = np.random.default_rng(5)
    t = np.linspace(0.0, 1.0, 20_000)
    clean = 0.7 * t * np.sin(2 * np.pi * 3 * t)
    noisy = clean + 0.002 * rng.uniform(-1.0, 1.0, t.size)
    noisy[0] = clean[0]
    ends = []
    for grain in (0.0, 0.004):
        basis = ShapedIntervalBasis.over(6, 2.0, parts=[], skew=0.1, grain=grain)
        apart = np.abs(regressors(basis, noisy)[:, 1:] - regressors(basis, clean)[:, 1:]).max()
        ends.append(apart)
    assert ends[1] < 0.02 < 0.1 < ends[0]


@pytest.mark.parametrize("skew", [0.2, -0.2])
def test_a_grain_takes_no_way_from_turns_that_leave_it(skew):
    """Only while it is in doubt does a turn count neither way: once it is certain all of it has counted."""
    u = np.array([0.0, 0.5, -0.3, 0.9, 0.1, 1.4, -1.2, 0.4, 0.2, 0.7])
    fine = np.concatenate([u[:1], *(np.linspace(*ends, 101)[1:] for ends in pairwise(u))])
    bases = (ShapedIntervalBasis.over(6, 2.0, parts=[], skew=skew, grain=g) for g in (0.0, 0.05))
    exact, grained = (regressors(b, fine) for b in bases)
    assert np.allclose(exact[100::100], grained[100::100], rtol=0, atol=1e-12)
    assert np.abs(exact - grained).sum(axis=1).max() < 1.01 * abs(skew) * 0.1


@settings(max_examples=40, deadline=None)
@given(inputs)
def test_the_reversible_part_is_a_function_of_the_deflection(u):
    basis = ShapedIntervalBasis.over(8, 2.0, parts=["reversible"], places=7)
    x = regressors(basis, u)
    points = np.delete(np.linspace(-1.0, 1.0, 7), 3)
    for row in x:
        z = row[:8].sum()
        wanted = [integral(z, q, basis.spacing) / abs(integral(q, q, basis.spacing)) for q in points]
        assert np.allclose(row[8:], 0.125 * np.array(wanted), atol=1e-12)


def test_position_cells_sum_to_the_intervals_they_split():
    """With the hat in the middle put back, the cells of a group are its xi: the plain operator is inside."""
    a = np.array([0.5, 0.7, 0.8])
    x = regressors(IntervalBasis(a), np.array([0.0, 0.9, -0.4, 0.6, 0.1]))
    z = x.sum(axis=1)
    outer, inner = z, z - x[:, 0]
    h, points = 0.5, np.linspace(-1.0, 1.0, 5)
    for k in range(len(x)):
        whole = sum(integral(outer[k], q, h) - integral(inner[k], q, h) for q in points)
        assert whole == pytest.approx(x[k, 0], abs=1e-12)


def test_position_makes_loops_asymmetric_and_leaves_them_congruent():
    """Loops between the same extremes have the same shape, wherever the memory comes from (Preisach)."""
    basis = ShapedIntervalBasis.over(8, 4.0, parts=["reversible", "position"])
    w = some_weights(basis, 4)
    sweep = np.concatenate([np.linspace(-0.2, 0.5, 9), np.linspace(0.5, -0.2, 9)])

    def loop(before):
        out = regressors(basis, np.concatenate([[0.0], before, sweep, sweep]))[-18:] @ w
        return out - out[0]

    assert np.allclose(loop([1.5, -1.2]), loop([-1.4, 1.3]), atol=1e-11)
    assert not np.allclose(loop([1.5]), -loop([1.5])[::-1] + loop([1.5])[8], atol=1e-3)


def test_the_output_part_makes_loops_non_congruent():
    basis = ShapedIntervalBasis.over(8, 4.0, parts=["output"])
    w = np.append(np.ones(8), [0.0, -3.0])
    sweep = np.concatenate([np.linspace(-0.2, 0.5, 9), np.linspace(0.5, -0.2, 9)])
    heights = [
        np.ptp((regressors(basis, np.array([0.0, *before, *sweep, *sweep])) @ w)[-18:])
        for before in ([1.9, -0.2], [0.1, -0.2])
    ]
    assert abs(heights[0] / heights[1] - 1.0) > 0.05


def test_it_fits_a_preisach_plane_that_the_symmetric_operator_cannot():
    rng = np.random.default_rng(2)
    plane = PreisachBasis(6, 1.0)
    density = rng.uniform(0.0, 1.0, plane.size)
    u = np.sin(np.cumsum(rng.normal(0.0, 0.3, 4000)))
    u -= u[0]
    u = np.clip(u, -0.95, 0.95)
    wanted = regressors(plane, u) @ density
    errors = []
    for parts in ([], ["reversible", "position"]):
        x = regressors(ShapedIntervalBasis.over(12, 2.0, parts=parts, places=9, groups=6), u)
        x = np.column_stack([x, np.ones(u.size)])
        w = np.linalg.lstsq(x[:2000], wanted[:2000], rcond=1e-9)[0]
        errors.append(np.sqrt(np.mean((x[2000:] @ w - wanted[2000:]) ** 2)) / np.abs(wanted).max())
    assert errors[1] < 0.25 * errors[0] and errors[1] < 0.02


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"parts": "position"}, "must be a list"),
        ({"parts": ["positon"]}, "did you mean 'position'"),
        ({"places": 4}, "odd number, 3 to 25"),
        ({"places": 5.5}, "odd number"),
        ({"groups": 9}, "1 to the 3 intervals"),
        ({"groups": 0}, "whole number"),
        ({"skew": 1.0}, "allowed is -0.9 to 0.9"),
        ({"grain": -1e-9}, "grain is -1e-09 m"),
        ({"grain": 3.0}, "0 to the range"),
        ({"shape": [1.0]}, "3 finite numbers"),
        ({"shape": [-1.0, -1.0, -1.0]}, "above 0"),
        ({"widths": []}, "empty"),
    ],
)
def test_what_it_refuses(change, says):
    with pytest.raises(ConfigError, match=says):
        ShapedIntervalBasis(**{"widths": [1.0, 1.0, 1.0], **change})


def test_parts_come_in_their_own_order_and_once():
    basis = ShapedIntervalBasis.over(4, 1.0, parts=["output", "reversible", "output"])
    assert basis.parts == ("reversible", "output") and basis.size == 4 + 4 + 2
    assert (
        ShapedIntervalBasis.from_dict({k: v for k, v in basis.to_dict().items() if k != "model"}).parts
        == basis.parts
    )
