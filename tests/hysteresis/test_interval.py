"""The interval operator against the paper's equations written out, and the properties of its memory."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.interval import AMOUNTS, FRONT, IntervalBasis, advance, respond
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.stage.identified import stop_bank

widths_ = st.lists(st.floats(0.01, 1.0), min_size=1, max_size=9).map(np.array)
moves = st.lists(st.one_of(st.floats(-3.0, 3.0), st.floats(-0.2, 0.2), st.just(0.0)), min_size=1, max_size=50)
motions = moves.map(lambda m: np.cumsum([0.3, *m]))
seeds = st.integers(0, 10_000)


def by_the_paper(widths, inputs):
    """Activations of every sample by (1) to (5) as printed: sums over all intervals before, no shortcut."""
    x = np.array(widths) / 2  # (5)
    out = [x]
    for before, now in pairwise(inputs):
        d = abs(now - before)  # (1)
        direction = np.sign(now - before)  # (2)
        new = x.copy()
        for i in range(len(widths)):
            if direction > 0:  # (3)
                used = sum(widths[j] - x[j] for j in range(i))
                new[i] = min(x[i] + max(d - used, 0.0), widths[i])
            elif direction < 0:  # (4)
                used = sum(x[j] for j in range(i))
                new[i] = max(x[i] - max(d - used, 0.0), 0.0)
        x = new
        out.append(x)
    return np.array(out)


def weights_for(widths, seed):
    return np.random.default_rng(seed).uniform(0.0, 5.0, len(widths))


def falling_weights_for(widths, seed):
    return np.sort(weights_for(widths, seed))[::-1]


@settings(max_examples=150, deadline=None)
@given(widths_, motions)
def test_activations_are_equations_3_and_4_sample_by_sample(widths, u):
    activations = regressors(IntervalBasis(widths), u) + widths / 2
    assert np.allclose(activations, by_the_paper(widths, u), rtol=0, atol=1e-12)
    assert (activations >= 0).all() and (activations <= widths + 1e-15).all()


@settings(max_examples=50, deadline=None)
@given(widths_, motions, seeds)
def test_output_is_equation_6_with_the_bias_that_centres_it(widths, u, seed):
    w = weights_for(widths, seed)
    bias = -np.sum(w * widths / 2)
    paper = by_the_paper(widths, u) @ w + bias
    assert np.allclose(HysteresisModel(IntervalBasis(widths), w).response(u), paper, rtol=0, atol=1e-11)
    assert paper[0] == pytest.approx(0.0, abs=1e-12)


@settings(max_examples=50, deadline=None)
@given(widths_, motions, seeds)
def test_the_batch_output_is_regressors_times_weights(widths, u, seed):
    basis, w = IntervalBasis(widths), weights_for(widths, seed)
    out = np.empty(u.size)
    state = basis.initial_state()
    respond(basis.vector(), state, w, 1.5, u, out)
    assert np.allclose(out, 1.5 + regressors(basis, u) @ w, rtol=0, atol=1e-11)
    # The state it leaves is the operator's own, so a batch can be continued.
    walked, x = basis.initial_state(), np.zeros(basis.size)
    for value in u:
        basis.kernel(basis.vector(), walked, x, value)
    assert np.allclose(state, walked, rtol=0, atol=1e-12)


def test_starts_anhysteretic_with_every_interval_half_full():
    basis = IntervalBasis([1.0, 2.0, 4.0])
    assert np.array_equal(basis.initial_state()[AMOUNTS:], [0.5, 1.0, 2.0])
    up, down = (regressors(basis, np.array([7.0, 7.0 + d])) for d in (0.7, -0.7))
    assert np.array_equal(up[1], -down[1])
    assert not up[0].any()


@settings(max_examples=50, deadline=None)
@given(widths_, st.floats(0.0, 5.0), seeds)
def test_weights_are_the_slopes_of_the_virgin_curve(widths, travel, seed):
    model = HysteresisModel(IntervalBasis(widths), weights_for(widths, seed))
    corners, force = model.virgin_curve()
    expected = np.interp(travel, corners, force)
    assert model.response(np.array([0.0, travel]))[-1] == pytest.approx(expected, abs=1e-11)


@settings(max_examples=50, deadline=None)
@given(widths_, motions, st.floats(0.01, 6.0), seeds)
def test_masing_every_branch_from_saturation_is_the_virgin_curve_doubled(widths, u, travel, seed):
    model = HysteresisModel(IntervalBasis(widths), weights_for(widths, seed))
    total = widths.sum()
    turn = u.max() + total  # beyond saturation, whatever came before
    out = model.response(np.concatenate([u, [turn, turn - travel]]))
    corners, force = model.virgin_curve()
    assert out[-2] - out[-1] == pytest.approx(2 * np.interp(travel / 2, corners, force), abs=1e-10)


@settings(max_examples=50, deadline=None)
@given(
    widths_, st.lists(st.floats(0.3, 0.95), min_size=1, max_size=6), st.floats(0.0, 1.0), st.floats(0.1, 2.0)
)
def test_masing_holds_on_every_nested_branch(widths, shrink, part, size):
    """Within the last loop, a branch depends on the way from its turning point only: 2 f(way / 2)."""
    model = HysteresisModel(IntervalBasis(widths), np.linspace(3.0, 1.0, len(widths)))
    turns = [0.0, size]
    for factor in shrink:
        turns.append(turns[-1] - np.sign(turns[-1] - turns[-2]) * factor * abs(turns[-1] - turns[-2]))
    way = part * abs(turns[-1] - turns[-2])
    out = model.response(np.array([*turns, turns[-1] - np.sign(turns[-1] - turns[-2]) * way]))
    corners, force = model.virgin_curve()
    expected = 2 * np.interp(way / 2, corners, force)
    assert abs(out[-1] - out[-2]) == pytest.approx(expected, abs=1e-10)


@settings(max_examples=50, deadline=None)
@given(widths_, motions, st.floats(0.05, 1.0), st.floats(0.1, 0.9), seeds)
def test_return_point_memory_a_minor_loop_closes_and_leaves_no_trace(widths, u, out_by, back_by, seed):
    """Turn, come back part of the way, return to the turn: output and future are as if never gone."""
    model = HysteresisModel(IntervalBasis(widths), weights_for(widths, seed))
    direction = 1.0 if seed % 2 else -1.0
    a = u[-1] + direction * out_by
    b = a - direction * out_by * back_by
    future = [a + direction * 0.3, a - 0.9, a + 0.4]
    straight = model.response(np.array([*u, a, *future]))
    detour = model.response(np.array([*u, a, b, a, *future]))
    assert np.allclose(detour[-4:], straight[-4:], rtol=0, atol=1e-10)


@settings(max_examples=50, deadline=None)
@given(widths_, motions, motions, st.floats(0.05, 1.0))
def test_congruency_loops_between_the_same_inputs_have_the_same_shape(widths, u, other, size):
    sweep = np.concatenate([np.linspace(0.0, size, 9), np.linspace(size, 0.0, 9)])

    def loop(history):
        out = regressors(IntervalBasis(widths), np.concatenate([history, sweep, sweep]))[-18:]
        return out - out[0]

    assert np.allclose(loop(u), loop(other), rtol=0, atol=1e-11)


@settings(max_examples=50, deadline=None)
@given(widths_, motions, seeds)
def test_wiping_out_larger_extremes_erase_smaller_ones(widths, u, seed):
    """Inserting small excursions before a larger one changes nothing after it."""
    w = weights_for(widths, seed)
    far = np.abs(u - u[0]).max() + 0.1
    model = HysteresisModel(IntervalBasis(widths), w)
    after = np.array([u[0] + far, u[0] - far, u[0] + 0.37 * far, u[0]])
    direct = model.response(np.concatenate([u[:1], after]))[-4:]
    assert np.allclose(model.response(np.concatenate([u, after]))[-4:], direct, rtol=0, atol=1e-10)


@settings(max_examples=50, deadline=None)
@given(widths_, motions, seeds)
def test_splitting_steps_and_resting_change_nothing(widths, u, seed):
    rng = np.random.default_rng(seed)
    fine, ends = [u[:1]], []
    for a, b in pairwise(u):
        part = a + (b - a) * np.sort(rng.uniform(0.0, 1.0, rng.integers(0, 5)))
        fine += [part, np.full(rng.integers(1, 3), b)]
        ends.append(sum(map(len, fine)) - 1)
    basis = IntervalBasis(widths)
    assert np.allclose(
        regressors(basis, np.concatenate(fine))[ends], regressors(basis, u)[1:], rtol=0, atol=1e-11
    )


@settings(max_examples=60, deadline=None)
@given(widths_, motions, seeds)
def test_non_increasing_weights_take_work_in_and_never_give_it_back_for_nothing(widths, u, seed):
    """Work done on the stop bank is stored energy, which is never negative, and heat, which only grows."""
    w = falling_weights_for(widths, seed)
    stiffness, reaches = w - np.append(w[1:], 0.0), np.cumsum(widths) / 2
    fine = np.concatenate([np.linspace(a, b, 60, endpoint=False) for a, b in pairwise(u)] + [u[-1:]])
    force = HysteresisModel(IntervalBasis(widths), w).response(fine)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(fine))])
    z = np.zeros(len(widths))
    stored = np.zeros(fine.size)
    for k in range(1, fine.size):
        z = np.clip(z + fine[k] - fine[k - 1], -reaches, reaches)
        stored[k] = 0.5 * stiffness @ z**2
    # The trapezium rule is off by curvature at corners only: bounded by the steps squared.
    slack = w.sum() * np.abs(np.diff(fine)) ** 2
    assert (np.diff(work - stored) >= -slack - 1e-12).all()
    assert (work >= -slack.sum() - 1e-12).all()


def test_a_closed_loop_costs_the_area_between_its_branches():
    """Between saturations the loss of a cycle is known, stop by stop: 4 k r (amplitude - r)."""
    widths, w = np.array([0.2, 0.4, 0.6]), np.array([5.0, 2.0, 1.0])
    amplitude = 1.5
    stiffness, reach = w - np.append(w[1:], 0.0), np.cumsum(widths) / 2
    cycle = amplitude * np.sin(np.linspace(0, 4 * np.pi, 40_001))
    force = HysteresisModel(IntervalBasis(widths), w).response(cycle)
    loss = np.trapezoid(force[20_000:], cycle[20_000:])
    assert loss == pytest.approx(np.sum(4 * stiffness * reach * (amplitude - reach)), rel=1e-5)


@settings(max_examples=60, deadline=None)
@given(widths_, motions, seeds)
def test_the_stop_bank_of_a_stage_is_the_same_friction(widths, u, seed):
    w = weights_for(widths, seed)
    bank = stop_bank({"model": "interval", "widths": widths.tolist(), "weights": w.tolist()})
    p, s = bank.vector(), bank.initial_state()
    from rtcomp.physics import wires

    forces = [0.0]
    for a, b in pairwise(u):
        wire = np.zeros(wires.COUNT)
        wire[wires.REACH] = wire[wires.SCALE] = 1.0
        wire[wires.MOVED] = b - a
        bank.kernel(p, s, wire)
        forces.append(wire[wires.FRICTION])
    model = HysteresisModel(IntervalBasis(widths), w)
    assert np.allclose(forces, model.response(u), rtol=0, atol=1e-10)


def test_memory_does_not_grow_with_history():
    basis = IntervalBasis.over(20, 2.0)
    assert basis.initial_state().size == basis.size + AMOUNTS
    state = basis.initial_state()
    walk = np.random.default_rng(1).normal(0.0, 0.1, 100_000).cumsum()
    out = regressors(basis, walk, state)
    assert state.size == basis.size + AMOUNTS
    assert (np.abs(out) <= basis.widths / 2).all()  # rounding never leaves an interval
    assert np.all((state[AMOUNTS:] >= 0) & (state[AMOUNTS:] <= basis.widths))


class CountingWrites(np.ndarray):
    """An array that counts what is written to it."""

    writes = 0

    def __setitem__(self, key, value):
        self.writes += 1
        super().__setitem__(key, value)


@pytest.mark.parametrize("count", [20, 1000])
def test_a_step_touches_the_intervals_it_fills_and_no_others(count):
    """In a stroke the front moves on; each interval is saturated once, whatever their number."""
    basis = IntervalBasis(np.full(count, 0.01))
    p, s = basis.vector(), basis.initial_state()
    x = np.zeros(count).view(CountingWrites)
    rng = np.random.default_rng(2)
    u, front, direction = 0.0, 0, 0.0
    advance.py_func(p, s, x, u)
    for move in rng.choice([0.001, 0.004, -0.001, -0.02, 0.05, 0.0], 3000):
        x.writes = 0
        u += move
        advance.py_func(p, s, x, u)
        if move == 0.0:
            assert x.writes == 0
            continue
        begun = front if np.sign(move) == direction else 0
        front, direction = int(s[FRONT]), np.sign(move)
        assert x.writes <= front - begun + 1
    assert np.allclose(x, s[AMOUNTS:] - 0.005, rtol=0, atol=1e-15)


def test_equal_motion_costs_the_same_with_many_intervals_as_with_few():
    """Small oscillation around one place: two intervals at the most are touched, of 20 or of 1000."""
    touched = {}
    for count in (20, 1000):
        basis = IntervalBasis(np.full(count, 0.01))
        p, s = basis.vector(), basis.initial_state()
        x = np.zeros(count).view(CountingWrites)
        for u in 0.007 * np.sin(0.1 * np.arange(2000)):
            advance.py_func(p, s, x, u)
        touched[count] = x.writes
    assert touched[20] == touched[1000] <= 2 * 2000


@pytest.mark.parametrize("bad", [-1e-6, 0.0, np.nan, np.inf, -np.inf])
def test_a_width_that_is_none_is_refused_by_place_and_value(bad):
    with pytest.raises(ConfigError, match=r"widths\[1\] is .* above 0") as caught:
        IntervalBasis([1e-6, bad, 1e-6])
    assert "\n" not in str(caught.value)


def test_no_widths_are_refused():
    with pytest.raises(ConfigError, match="empty"):
        IntervalBasis([])


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 50), st.floats(1e-6, 10.0), st.floats(0.01, 100.0))
def test_spread_over_a_range(count, total, spacing):
    widths = IntervalBasis.over(count, total, spacing).widths
    assert widths.sum() == pytest.approx(total) and len(widths) == count
    if count > 1:
        assert widths[-1] / widths[0] == pytest.approx(spacing)
