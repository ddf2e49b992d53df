"""Intervals that place themselves: the same operator at every moment, never a step, and a better place."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.gradient import Gradient
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.learner import Learner, followed, learn, learn_places
from rtcomp.hysteresis.lms import Lms, Nlms
from rtcomp.hysteresis.moving.places import CHANGE_WIDTH, CHANGED, INTERVALS, MERGED, PART, SHARE, SPLIT
from rtcomp.hysteresis.moving.placing import place
from rtcomp.hysteresis.moving.self_placing import MOST_INTERVALS, SelfPlacingBasis, cells_of, widths_now
from rtcomp.hysteresis.rls import Rls

widths_ = st.lists(st.floats(0.01, 1.0), min_size=1, max_size=9).map(np.array)
moves = st.lists(st.one_of(st.floats(-3.0, 3.0), st.floats(-0.2, 0.2), st.just(0.0)), min_size=1, max_size=50)
motions = moves.map(lambda m: np.cumsum([0.3, *m]))


def bending(reach: float, fine: int = 400):
    """The slopes of a branch that bends within `reach` of the range, on `fine` equal intervals."""
    way = (np.arange(fine) + 0.5) / fine
    slopes = np.exp(-way / reach)
    return IntervalBasis.over(fine, 1.0), 2.0 * fine * slopes / slopes.sum()


def cycles(count: int, seed: int = 0, amplitude: float = 0.55, samples: int = 500):
    """Sines through saturation whose amplitude goes up and down."""
    time = np.arange(count * samples) / samples
    phase = np.random.default_rng(seed).uniform(0.0, 3.0)
    up = 0.15 + 0.85 * np.abs(np.sin(np.pi * time / 7.3 + phase))
    return amplitude * up * np.sin(2 * np.pi * time)


def off(basis, weights, inputs, wanted):
    return np.sqrt(np.mean((regressors(basis, inputs) @ weights - wanted) ** 2)) / np.abs(wanted).max()


@settings(max_examples=100, deadline=None)
@given(widths_, motions)
def test_it_is_the_interval_operator(widths, u):
    ours = regressors(SelfPlacingBasis(widths), u)
    assert np.allclose(ours, regressors(IntervalBasis(widths), u), rtol=0, atol=1e-12)


@settings(max_examples=50, deadline=None)
@given(widths_)
def test_cells_hold_the_boundaries_of_the_start(widths):
    edges, corners = cells_of(widths)
    assert np.allclose(corners[edges.astype(int)], np.append(0.0, np.cumsum(widths)), rtol=1e-12)
    assert (np.diff(corners) > 0).all()
    basis = SelfPlacingBasis(widths)
    assert np.allclose(widths_now(basis.vector()), widths, rtol=1e-9)
    assert isinstance(basis.settled(basis.vector()), IntervalBasis)


class Stepwise:
    """Identifier and compensator on one basis with one learner, stepped from outside."""

    def __init__(self, count: int, reach: float, lag: int) -> None:
        self.basis = SelfPlacingBasis.over(count, 1.0)
        self.p, self.s, self.x = self.basis.vector(), self.basis.initial_state(), np.zeros(count)
        self.lead_s, self.lead_x = self.basis.initial_state(), np.zeros(count)
        self.w, self.begun = np.zeros(count), np.arange(count, 0.0, -1.0)
        self.scales, self.learner = self.basis.scales().copy(), Rls(0.9995)
        self.lp, self.ls = self.learner.vector(self.scales), self.learner.initial_state(self.scales)
        self.memory, self.change = self.basis.memory(0.002), np.zeros(CHANGE_WIDTH)
        self.fine, self.slopes = bending(reach)
        self.lag = lag

    def changes(self, inputs):
        """Run over `inputs`, the compensator `lag` samples ahead; yield before and after each change."""
        force = regressors(self.fine, inputs) @ self.slopes
        kernel = self.basis.kernel
        for k in range(inputs.size - self.lag):
            kernel(self.p, self.s, self.x, inputs[k])
            kernel(self.p, self.lead_s, self.lead_x, inputs[k + self.lag])
            error = force[k] - self.w @ self.x
            self.learner.kernel(self.lp, self.ls, self.x, self.w, error)
            before = self.seen()
            place(
                self.p, self.s, self.x, self.lead_s, self.lead_x, self.w, self.begun, self.scales,
                self.memory, self.change, force[k], error,
            )  # fmt: skip
            if self.change[CHANGED]:
                self.learner.regroup(self.lp, self.ls, self.scales, self.change)
                yield k, before, self.seen()

    def seen(self):
        return {
            "output": self.w @ self.x, "lead": self.w @ self.lead_x, "widths": widths_now(self.p),
            "height": self.w @ widths_now(self.p), "begun": self.begun @ widths_now(self.p),
        }  # fmt: skip


@pytest.mark.parametrize("lag", [0, 7])
def test_a_change_makes_no_step_and_keeps_what_was_there(lag):
    inputs = cycles(12, samples=300)
    axis, changes = Stepwise(12, 0.15, lag), 0
    for k, before, after in axis.changes(inputs):
        changes += 1
        assert after["output"] == pytest.approx(before["output"], abs=1e-12)
        assert after["lead"] == pytest.approx(before["lead"], abs=1e-12)
        assert after["height"] == pytest.approx(before["height"], rel=1e-12)
        assert after["begun"] == pytest.approx(before["begun"], rel=1e-12)
        assert after["widths"].size == 12 and after["widths"].sum() == pytest.approx(1.0)
        assert not np.array_equal(after["widths"], before["widths"])
        assert np.allclose(axis.scales, after["widths"] / 2, rtol=1e-12)
        # As if the intervals had lain there from the first sample on, for either.
        now = IntervalBasis(after["widths"])
        assert np.allclose(axis.x, regressors(now, inputs[: k + 1])[-1], rtol=0, atol=1e-12)
        assert np.allclose(axis.lead_x, regressors(now, inputs[lag : k + lag + 1])[-1], rtol=0, atol=1e-12)
    assert changes >= 5


def test_nothing_moves_before_there_is_something_to_go_by_nor_without_force():
    axis = Stepwise(12, 0.15, 0)
    assert next(axis.changes(cycles(12, samples=300)))[0] >= 10 * 12
    silent = Stepwise(12, 0.15, 0)
    silent.slopes = np.zeros_like(silent.slopes)
    assert not list(silent.changes(cycles(6, samples=300)))


@pytest.mark.parametrize("learner", [Rls(0.9995), Nlms(0.3), Lms(0.3), Gradient(0.3)], ids=lambda k: k.name)
@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_places_itself_where_the_curve_bends(learner, noise):
    fine, slopes = bending(0.05)
    own, other = cycles(60), cycles(12, 1)
    force, wanted = regressors(fine, own) @ slopes, regressors(fine, other) @ slopes
    force = force + noise * np.random.default_rng(0).standard_normal(force.size)
    equal = IntervalBasis.over(20, 1.0)
    before = off(equal, learn(equal, learner, own, force, 0.002), other, wanted)
    placed, weights = learn_places(SelfPlacingBasis.over(20, 1.0), learner, own, force, 0.002)
    assert placed.size == 20
    assert np.count_nonzero(np.cumsum(placed.widths) < 0.15) >= 6
    assert off(placed, weights, other, wanted) < (0.33 if learner.name == "rls" else 0.9) * before


def test_straight_and_equally_bent_curves_keep_equal_intervals():
    for bend in (0.0, 1.0):
        fine = IntervalBasis.over(400, 1.0)
        slopes = 1.0 - bend * (np.arange(400) + 0.5) / 400
        own = cycles(40)
        placed, _ = learn_places(
            SelfPlacingBasis.over(10, 1.0), Rls(0.9995), own, regressors(fine, own) @ slopes, 0.002
        )
        assert placed.widths.max() < 1.7 * placed.widths.min()


def test_a_range_far_larger_than_the_motion_is_no_loss():
    """All of the motion within the first of equal intervals: the others come to where it is."""
    fine, slopes = bending(0.2)
    own, other = cycles(60), cycles(12, 1)
    force, wanted = regressors(fine, own) @ slopes, regressors(fine, other) @ slopes
    equal = IntervalBasis.over(20, 1000.0)
    before = off(equal, learn(equal, Rls(0.9995), own, force, 0.002), other, wanted)
    placed, weights = learn_places(SelfPlacingBasis.over(20, 1000.0), Rls(0.9995), own, force, 0.002)
    assert np.count_nonzero(np.cumsum(placed.widths) <= 1.2) >= 5
    assert off(placed, weights, other, wanted) < 0.2 * before


def test_widths_do_not_collapse():
    """One kink draws every boundary near; none comes closer than learning can tell."""
    fine = IntervalBasis.over(400, 1.0)
    slopes = np.where(np.arange(400) < 120, 3.0, 0.1)
    own = cycles(60)
    force = regressors(fine, own) @ slopes
    for gate in (0.0, 0.01):
        placed, weights = learn_places(SelfPlacingBasis.over(20, 1.0), Rls(0.9995), own, force, gate)
        assert placed.widths.min() >= max(2.0 * gate, 0.9 / (16 * 20))
        assert np.isfinite(weights).all()


def test_one_direction_only_moves_nothing_wrong():
    own = np.linspace(0.0, 3.0, 4000)
    fine, slopes = bending(0.1)
    placed, weights = learn_places(
        SelfPlacingBasis.over(12, 1.0), Rls(0.9995), own, regressors(fine, own) @ slopes, 0.002
    )
    assert np.isfinite(weights).all() and placed.widths.sum() == pytest.approx(1.0)


def test_at_rest_and_in_saturation_nothing_changes():
    fine, slopes = bending(0.1)
    own = np.concatenate([cycles(20), np.full(20_000, 2.0), np.linspace(2.0, 9.0, 20_000)])
    force = regressors(fine, own) @ slopes
    force[10_000:] += 0.01 * np.random.default_rng(0).standard_normal(40_000)
    early, _ = learn_places(SelfPlacingBasis.over(12, 1.0), Rls(0.9995), own[:11_000], force[:11_000], 0.002)
    late, weights = learn_places(SelfPlacingBasis.over(12, 1.0), Rls(0.9995), own, force, 0.002)
    assert np.isfinite(weights).all()
    assert np.abs(np.cumsum(late.widths) - np.cumsum(early.widths)).max() < 0.3


@settings(max_examples=60, deadline=None)
@given(st.integers(3, 9), st.data())
def test_the_covariance_follows(count, data):
    """Against the change written as a matrix; what is inflated beyond it is no more than said."""
    offset = data.draw(st.booleans())
    n = count + offset
    i = data.draw(st.integers(0, count - 2))
    k = data.draw(st.integers(0, count - 2))
    share, part = data.draw(st.floats(0.1, 0.9)), data.draw(st.floats(0.1, 0.9))
    draw = np.random.default_rng(data.draw(st.integers(0, 1000)))
    scales = draw.uniform(0.5, 1.5, n)
    learner = Rls(0.999, trust=1e3)
    p, s = learner.vector(scales), learner.initial_state(scales)
    root = draw.normal(size=(n, n))
    covariance = root @ root.T + np.eye(n)
    s[: n * n] = covariance.ravel()
    change = np.zeros(CHANGE_WIDTH)
    change[[INTERVALS, MERGED, SPLIT, SHARE, PART, CHANGED]] = count, i, k, share, part, 1
    learner.regroup(p, s, scales, change)
    merge = np.delete(np.eye(n), i + 1, axis=0)
    merge[i, i], merge[i, i + 1] = share, 1.0 - share
    split = np.insert(np.eye(n - 1), k + 1, np.eye(n - 1)[k], axis=0)
    wanted = split @ merge @ covariance @ merge.T @ split.T
    after = s[: n * n].reshape(n, n)
    assert np.array_equal(after, after.T) and (np.linalg.eigvalsh(after) > 0).all()
    # The mean of the two parts is as well known as the one was, but for what every variance grows by.
    whole = np.eye(n)
    whole[k, k], whole[k, k + 1] = part, 1.0 - part
    whole = np.delete(whole, k + 1, axis=0)
    known, was = whole @ after @ whole.T, whole @ wanted @ whole.T
    assert (np.diag(known) <= 3.0 * np.diag(was) * (1 + 1e-9)).all()
    assert (np.diag(known) >= np.diag(was) * (1 - 1e-9)).all()
    assert np.allclose(p[2:-2], (1e3 / scales) ** 2)


def test_learners_that_cannot_follow_are_refused():
    class Stubborn(Learner):
        name = "stubborn"

    with pytest.raises(
        ConfigError, match="learner stubborn cannot follow the elements of model self-placing"
    ):
        followed(SelfPlacingBasis.over(5, 1.0), Stubborn())
    assert followed(IntervalBasis.over(5, 1.0), Stubborn()) == (0, 0)


def test_too_many_intervals_are_refused():
    with pytest.raises(ConfigError, match="1001 intervals; allowed are 1 to 1000"):
        SelfPlacingBasis.over(MOST_INTERVALS + 1, 1.0)


@pytest.mark.parametrize("count", [1, 2, 3, 50])
def test_any_number_of_intervals_learns(count):
    fine, slopes = bending(0.1)
    own = cycles(20)
    placed, weights = learn_places(
        SelfPlacingBasis.over(count, 1.0), Rls(0.9995), own, regressors(fine, own) @ slopes, 0.002
    )
    assert placed.size == count and np.isfinite(weights).all()
    assert all(a < b for a, b in pairwise(np.cumsum(placed.widths)))


def test_what_does_not_count_is_moved_through_and_nothing_else():
    fine, slopes = bending(0.05)
    own = cycles(30)
    force = regressors(fine, own) @ slopes
    counted = np.ones(own.size, dtype=np.bool_)
    counted[2000:3500] = counted[9000:9007] = False
    start, learner = SelfPlacingBasis.over(12, 1.0), Rls(0.9995)
    one, w = learn_places(start, learner, own, force, 0.002, counted)
    other, v = learn_places(start, learner, own, np.where(counted, force, np.nan), 0.002, counted)
    assert np.array_equal(one.widths, other.widths) and np.array_equal(w, v)
    assert not np.allclose(one.widths, start.widths)
    whole, u = learn_places(start, learner, own, force, 0.002)
    judged, wanted = cycles(12, 1), regressors(fine, cycles(12, 1)) @ slopes
    assert off(one, w, judged, wanted) < 1.5 * off(whole, u, judged, wanted)


def test_a_constant_force_is_learned_beside_the_places():
    fine, slopes = bending(0.05)
    own = cycles(30)
    force = regressors(fine, own) @ slopes + 2.0
    start = SelfPlacingBasis.over(12, 1.0)
    found, w = learn_places(start, Rls(0.9995), own, force, 0.002, offset=True)
    assert w[-1] * start.scales().mean() == pytest.approx(2.0, abs=0.01)
    assert not np.allclose(found.widths, start.widths)
