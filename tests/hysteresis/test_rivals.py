"""Stop, extended stop and Preisach operators: the properties each has, and what they have in common."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.extended_stop import ExtendedStopBasis
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.preisach import COUNT, DEPTH, PreisachBasis
from rtcomp.hysteresis.stop import StopBasis

inputs = st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=60).map(lambda a: np.array([0.0, *a]))
seeds = st.integers(0, 10_000)

BASES = [
    StopBasis([0.1, 0.25, 0.6, 1.1]),
    ExtendedStopBasis([0.1, 0.25, 0.6], travel=1.0),
    PreisachBasis(7, 1.5),
    PreisachBasis(8, 1.5),
]
every = pytest.mark.parametrize("basis", BASES, ids=lambda b: f"{b.name}-{b.size}")


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0.01, 1.0), min_size=1, max_size=8), inputs, seeds)
def test_a_stop_bank_of_the_same_virgin_curve_equals_the_interval_operator(widths, u, seed):
    """Weights w_i over widths a_i are stops of reach sum_{j<=k} a_j / 2 and stiffness w_k - w_{k+1}."""
    w = np.random.default_rng(seed).uniform(0.0, 5.0, len(widths))
    stiffness = w - np.append(w[1:], 0.0)
    by_intervals = regressors(IntervalBasis(widths), u) @ w
    by_stops = regressors(StopBasis(np.cumsum(widths) / 2), u) @ stiffness
    assert np.allclose(by_intervals, by_stops, rtol=0, atol=1e-11 * (1 + w.sum() * sum(widths)))


@every
@settings(max_examples=30, deadline=None)
@given(u=inputs, seed=seeds)
def test_splitting_a_step_changes_nothing(basis, u, seed):
    rng = np.random.default_rng(seed)
    cuts = [np.linspace(a, b, rng.integers(2, 6)) for a, b in pairwise(u)]
    fine = np.concatenate([[u[0]], *(c[1:] for c in cuts)])
    ends = np.cumsum([len(c) - 1 for c in cuts])
    assert np.allclose(regressors(basis, fine)[ends], regressors(basis, u)[1:], rtol=0, atol=1e-12)


@every
@settings(max_examples=30, deadline=None)
@given(u=inputs)
def test_an_excursion_beyond_all_extremes_wipes_them_out(basis, u):
    outside = 1.2 * np.abs(u).max() + 0.1
    direct = regressors(basis, np.array([0.0, outside, -0.3]))[-2:]
    after = regressors(basis, np.concatenate([u, [outside, -0.3]]))[-2:]
    assert np.allclose(after, direct, rtol=0, atol=1e-12)


@every
@settings(max_examples=30, deadline=None)
@given(u=inputs, away=st.floats(-1.5, 1.5))
def test_a_loop_closes_where_it_began(basis, u, away):
    """After coming from a turning point: going away and back there returns the output of the turn."""
    if len(u) < 3:
        return
    a, b = u[-2], u[-1]
    c = b + away * (a - b) / 3.0 if abs(away) < 1 else (a + b) / 2
    c = np.clip(c, min(a, b), max(a, b))
    out = regressors(basis, np.concatenate([u, [c, b]]))
    assert np.allclose(out[-1], out[-3], rtol=0, atol=1e-12)


@every
@settings(max_examples=30, deadline=None)
@given(u=inputs, low=st.floats(-1.0, 0.3), size=st.floats(0.05, 0.5))
def test_loops_between_the_same_extremes_are_congruent(basis, u, low, size):
    high = low + size
    sweep = np.concatenate([np.linspace(low, high, 7), np.linspace(high, low, 7)])

    def loop(before):
        out = regressors(basis, np.concatenate([before, sweep, sweep]))[-14:]
        return out - out[0]

    assert np.allclose(loop(u), loop(np.array([0.0, 1.4, -1.4])), rtol=0, atol=1e-12)


@every
@settings(max_examples=20, deadline=None)
@given(u=inputs)
def test_the_mirrored_motion_gives_the_mirrored_output(basis, u):
    if isinstance(basis, PreisachBasis):
        rows, columns = np.tril_indices(basis.divisions)
        place = {(r, c): n for n, (r, c) in enumerate(zip(rows, columns, strict=True))}
        last = basis.divisions - 1
        mirror = [place[last - c, last - r] for r, c in zip(rows, columns, strict=True)]
    else:
        mirror = list(range(basis.size))
    assert np.allclose(regressors(basis, -u)[:, mirror], -regressors(basis, u), rtol=0, atol=1e-12)


@every
@settings(max_examples=20, deadline=None)
@given(u=inputs, origin=st.floats(-3.0, 3.0))
def test_only_the_way_from_the_start_matters(basis, u, origin):
    assert np.allclose(regressors(basis, u + origin), regressors(basis, u), rtol=0, atol=1e-11)


@every
def test_rests_cost_nothing_and_change_nothing(basis):
    u = np.array([0.0, 0.7, -0.2, 0.1])
    assert np.array_equal(regressors(basis, np.repeat(u, 3))[2::3], regressors(basis, u))


@settings(max_examples=30, deadline=None)
@given(inputs)
def test_stops_keep_to_their_reach_and_follow_the_recursion(u):
    basis = StopBasis([0.1, 0.25, 0.6, 1.1])
    out = regressors(basis, u)
    z = np.zeros(4)
    for k in range(1, len(u)):
        z = np.clip(z + u[k] - u[k - 1], -basis.reaches, basis.reaches)
        assert np.allclose(out[k], z, rtol=0, atol=1e-12)


def test_spread_alike_stops_and_intervals_have_their_corners_in_the_same_places():
    intervals, stops = IntervalBasis.over(9, 3e-5, 8.0), StopBasis.over(9, 3e-5, 8.0)
    assert np.allclose(np.cumsum(intervals.widths) / 2, stops.reaches, rtol=1e-12)
    assert ExtendedStopBasis.over(9, 3e-5).size == 9
    assert PreisachBasis.over(20, 2.0).divisions == 5 and PreisachBasis.over(21, 2.0).divisions == 6


def test_extended_stops_go_on_rising_after_yielding():
    basis = ExtendedStopBasis([0.1, 0.2])
    out = regressors(basis, np.array([2.0, 2.05, 3.0, 4.0]))
    assert out[:, 2].tolist() == pytest.approx([0.0, 0.05, 1.0, 2.0])
    assert np.array_equal(out[2, :2], out[3, :2])


def test_stops_lead_and_relays_lag():
    """Friction loses work on every loop; a Preisach plane of positive density turns the other way round.

    So the plane needs negative densities off its diagonal to be friction, and its learner must allow them.
    """
    u = 0.9 * np.sin(np.linspace(0.0, 4.0 * np.pi, 2001))
    work = {
        basis.name: np.trapezoid(regressors(basis, u)[1000:] @ np.ones(basis.size), u[1000:])
        for basis in (StopBasis.over(6, 1.0), ExtendedStopBasis.over(6, 1.0), PreisachBasis.over(21, 2.0))
    }
    assert work["stop"] > 0.1 and work["extended-stop"] > 0.1 and work["preisach"] < -0.1


class Relays:
    """The Preisach plane by brute force: a fine grid of relays, switched one by one."""

    def __init__(self, divisions: int, reach: float, fine: int) -> None:
        n = divisions * fine
        middle = reach * ((2 * np.arange(n) + 1) / n - 1)
        self.alpha, self.beta = np.meshgrid(middle, middle, indexing="ij")
        self.inside = np.tril(np.ones((n, n))) - 0.5 * np.eye(n)
        self.up = np.where(
            self.alpha + self.beta < -1e-12, 1.0, np.where(self.alpha + self.beta > 1e-12, -1.0, 0)
        )
        self.virgin = self.up.copy()
        self.shape = (divisions, fine, divisions, fine)
        self.side = 2 * reach / divisions

    def feed(self, u: float, rising: bool):
        if rising:
            self.up[self.alpha < u] = 1.0
        else:
            self.up[self.beta > u] = -1.0
        change = ((self.up - self.virgin) * self.inside).reshape(self.shape)
        cells = change.sum(axis=(1, 3)) / self.shape[1] ** 2 * self.side
        return cells[np.tril_indices(self.shape[0])]


@pytest.mark.parametrize("divisions", [1, 4, 5])
def test_preisach_is_the_plane_of_relays(divisions):
    rng = np.random.default_rng(divisions)
    u = np.concatenate([[0.0], rng.uniform(-1.1, 1.1, 80), rng.normal(0.0, 0.2, 80)])
    fine = 60
    relays, out = Relays(divisions, 1.0, fine), regressors(PreisachBasis(divisions, 1.0), u)
    for k in range(1, len(u)):
        cells = relays.feed(u[k], u[k] > u[k - 1])
        # A grid line of relays is one row in `fine` of a cell; two borders may cut it.
        assert np.abs(out[k] - cells).max() <= 2.0 / divisions * 4.0 / fine


def test_preisach_memory_is_bounded_and_its_output_stays_within_the_cells():
    basis = PreisachBasis(5, 1.0)
    room = DEPTH * 5 + 4
    u = np.empty(2 * 4 * room)
    u[0::2] = np.linspace(1.0, 0.01, u.size // 2)
    u[1::2] = -np.linspace(0.995, 0.005, u.size // 2)
    u = np.concatenate([[0.0], u])
    state = basis.initial_state()
    out = regressors(basis, u, state)
    assert state[COUNT] <= room
    virgin = np.sign(4 - np.add(*np.tril_indices(5)))
    share = out / basis.scales() + virgin
    assert np.abs(share).max() <= 1.0 + 1e-9
    full = basis.initial_state()
    big = PreisachBasis(40, 1.0)
    assert full.size < big.initial_state().size
    # The same history in a memory that never fills, its cells summed to the coarse ones.
    fine = regressors(big, u)[-1] * big.side
    rows, columns = (i // 8 for i in np.tril_indices(40))
    coarse = np.zeros((5, 5))
    np.add.at(coarse, (rows, columns), fine)
    exact = coarse[np.tril_indices(5)] / basis.side
    assert np.abs(out[-1] - exact).max() < 0.25 * basis.side
    assert np.abs(out[-1]).max() > 0.1 * basis.side
    # And wiping-out still returns to the exact output.
    after = regressors(basis, np.concatenate([u, [-1.0, 0.4]]))[-1]
    assert np.allclose(after, regressors(basis, np.array([0.0, -1.0, 0.4]))[-1], atol=1e-12)


def test_preisach_rounding_does_not_add_up():
    basis = PreisachBasis(6, 1.0)
    u = np.random.default_rng(3).normal(0.0, 1e-3, 200_000).cumsum()
    u = np.concatenate([u - u[0], [1.0, 0.2]])
    expected = regressors(basis, np.array([0.0, 1.0, 0.2]))[-1]
    assert np.allclose(regressors(basis, u)[-1], expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: StopBasis([]), "empty"),
        (lambda: StopBasis([1.0, -1.0]), r"reaches\[1\] is -1 m"),
        (lambda: StopBasis([np.nan]), "above 0"),
        (lambda: StopBasis.from_dict({"reach": [1.0]}), "'reaches'"),
        (lambda: ExtendedStopBasis([1.0], travel=0.0), "travel is 0 m"),
        (lambda: ExtendedStopBasis.from_dict({"reaches": [1.0], "travl": 1}), "'travl'.*'travel'"),
        (lambda: PreisachBasis(0, 1.0), "divisions is 0"),
        (lambda: PreisachBasis(201, 1.0), "divisions is 201"),
        (lambda: PreisachBasis(3, -1.0), "reach is -1 m"),
        (lambda: PreisachBasis.over(20, 1.0, spacing=3.0), "spacing is 3"),
        (lambda: PreisachBasis.from_dict({"reach": 1.0}), "'divisions' is missing"),
    ],
)
def test_operators_that_cannot_be_are_refused_in_one_line(make, says):
    with pytest.raises(ConfigError, match=says) as caught:
        make()
    assert "\n" not in str(caught.value)
