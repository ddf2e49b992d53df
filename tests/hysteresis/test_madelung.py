"""Branches that differ by direction: they close, forget as they must, and are those of exponents 1 +- a."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.madelung import COUNT, DEPTH, FORMS, LEANS, STATES, lean, psi
from rtcomp.hysteresis.shaped import ShapedIntervalBasis
from rtcomp.kernels import compiled
from rtcomp.physics.closing import DEPTH as TURNS_KEPT
from rtcomp.physics.closing import TURNS, bend

outputs = st.lists(st.floats(-0.99, 0.99), min_size=2, max_size=30).map(lambda a: np.array([0.0, *a]))


@compiled
def leant(path, s):
    out = np.zeros((path.size, 2))
    for k in range(path.size):
        lean(s, 0, path[k])
        out[k] = s[LEANS : LEANS + 2]
    return out


@compiled
def bent(path, s, asymmetry):
    out = np.zeros(path.size)
    for k in range(path.size):
        out[k] = bend(s, path[k], asymmetry, 0.0)
    return out


def fresh():
    return np.zeros(STATES)


@settings(max_examples=60, deadline=None)
@given(outputs)
def test_the_first_form_is_what_a_little_of_an_exponent_does(path):
    a = 1e-5
    plain = np.zeros(TURNS + 2 * TURNS_KEPT)
    change = (bent(path, plain.copy(), a) - bent(path, plain.copy(), -a)) / (2.0 * a)
    assert np.allclose(leant(path, fresh())[:, 0], change, rtol=0, atol=1e-4)


@settings(max_examples=60, deadline=None)
@given(outputs, st.lists(st.floats(0.001, 0.999), min_size=1, max_size=10))
def test_an_excursion_between_the_last_two_turns_leaves_no_trace(path, between):
    low, high = path[-2], path[-1]
    if abs(high - low) < 1e-6:
        return
    inside = low + (high - low) * np.array(between)
    after = leant(np.concatenate([path, inside, [high]]), fresh())
    assert np.allclose(after[-1], after[path.size - 1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("ends", [(0.31, 0.29), (0.05, -0.07, 0.33, 0.3), (0.9, -0.95)])
def test_loops_close_a_hundred_thousand_times(ends):
    s = fresh()
    leant(np.array([0.0, 0.97, -0.96, *ends]), s)
    first = leant(np.array(ends), s)
    last = leant(np.tile(ends, 100_000), s)[-len(ends) :]
    assert np.allclose(first, last, rtol=0, atol=1e-12)


def test_where_all_slides_nothing_leans_and_nothing_is_remembered():
    s = fresh()
    leant(np.array([0.0, 0.5, -0.4, 0.2, 1.0]), s)
    assert not s[LEANS : LEANS + FORMS].any() and s[COUNT] == 0.0
    back = leant(np.linspace(1.0, -1.0, 201), s)
    assert (back[1:-1] > 0.0).all() and not back[-1].any()
    assert back[100] == pytest.approx([2.0 * psi(0, 0.5), 2.0 * psi(1, 0.5)])


def test_more_turns_than_are_kept_lose_the_smallest_loops():
    """A spiral of more turns than the memory holds: it goes on, its outermost loop still closes."""
    turns = 0.9 * 0.97 ** np.arange(3 * DEPTH) * (-1.0) ** np.arange(3 * DEPTH)
    s = fresh()
    path = leant(np.concatenate([[0.0], turns]), s)
    assert s[COUNT] < DEPTH and np.isfinite(path).all()
    assert np.allclose(leant(turns[1:2], s)[0], path[2], rtol=0, atol=1e-9)


def test_the_part_is_learned_and_mends_an_asymmetry_that_closes():
    """The plant bends the whole output by the exponent; symmetric, and with branches, on other motion."""
    rng = np.random.default_rng(1)
    turns = np.concatenate([[0.0], rng.uniform(-0.9, 0.9, 300)])
    u = np.interp(np.arange(9000) / 30.0, np.arange(turns.size), turns)
    plain = IntervalBasis.over(12, 2.0)
    slopes = np.exp(-3.0 * np.arange(12) / 12)
    o = regressors(plain, u) @ slopes / (slopes @ plain.widths / 2)
    force = bent(o, np.zeros(TURNS + 2 * TURNS_KEPT), 0.3)
    half = slice(0, 4500)
    missed = {}
    for parts in ((), ("branches",)):
        x = regressors(ShapedIntervalBasis(plain.widths, parts, shape=slopes), u)
        w = np.linalg.lstsq(x[half], force[half], rcond=None)[0]
        missed[parts] = np.sqrt(np.mean((x @ w - force)[4500:] ** 2))
    assert missed[("branches",)] < 0.1 * missed[()]
