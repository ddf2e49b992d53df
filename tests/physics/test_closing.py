"""Bent branches that close: against their closed form, and what a memory without drift must keep."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from rtcomp import physics
from rtcomp.errors import ConfigError
from rtcomp.physics.closing import DEPTH
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.physics.rows import motion_rows, over_rows
from rtcomp.physics.wires import FRICTION

REACH = 5e-6
CURVE = MaxwellSlip([(4e5, 1e-6), (3e5, 2e-6), (2e5, 3.5e-6), (1e5, 5e-6)])
LEVEL = CURVE.level


def closing(asymmetry: float) -> physics.Effect:
    return physics.build({"name": "asymmetric-friction", "asymmetry": asymmetry, "closing": 1.0})


def softer(softening: float) -> physics.Effect:
    return physics.build({"name": "non-congruent-friction", "form": "branches", "softening": softening})


def force(x: np.ndarray, *effects: physics.Effect) -> np.ndarray:
    """Friction (N) along positions from 0, of the elements above and `effects` with what they bring."""
    chain = [CURVE, *effects, *(c for e in effects for c in e.companions())]
    rows = motion_rows(np.asarray(x, dtype=float), 1e-3)
    return over_rows(sorted(chain, key=lambda e: (e.place, e.order)), rows)[:, FRICTION]


def path(*corners: float, step: float = 5e-8) -> np.ndarray:
    """Positions from 0 through `corners`, all of them among these."""
    x = [0.0]
    for corner in corners:
        count = max(round(abs(corner - x[-1]) / step), 1)
        x += list(np.linspace(x[-1], corner, count + 1)[1:])
    return np.array(x[1:])


def test_branches_from_sliding_are_the_models_to_another_exponent() -> None:
    a, x = 0.25, path(-3e-5, 3e-5)
    plain, bent = force(x), force(x, closing(a))
    up = np.arange(x.size) >= np.argmin(x)
    part = 0.5 * (plain / LEVEL + 1.0)
    np.testing.assert_allclose(bent[up] / LEVEL, 1.0 - 2.0 * (1.0 - part[up]) ** (1.0 + a), atol=1e-9)
    mirrored = force(-x, closing(-a))
    np.testing.assert_allclose(mirrored, -bent, atol=1e-12)


def test_the_first_branch_is_as_much_stiffer_as_asked_for() -> None:
    for a in (-0.3, 0.2):
        up, down, plain = (force(s * path(1e-9, step=1e-9), closing(a))[0] for s in (1.0, -1.0, 0.0))
        assert plain == 0.0
        assert (up + down) / (up - down) == pytest.approx(a, rel=1e-3)


def test_the_first_branch_is_steeper_by_the_softening_and_those_from_sliding_are_the_models() -> None:
    s = 0.8
    first = path(REACH)
    plain, bent = force(first) / LEVEL, force(first, softer(s)) / LEVEL
    np.testing.assert_allclose(bent, 1.0 - (1.0 - plain) ** (1.0 + s), atol=1e-9)
    slid = path(-3e-5, 3e-5, -1e-5)
    last = np.arange(slid.size) > np.argmin(slid)
    np.testing.assert_allclose(force(slid, softer(s))[last], force(slid)[last], atol=1e-9 * LEVEL)


def test_equal_branches_differ_by_the_force_at_which_they_begin_only_when_bent() -> None:
    def back(*effects: physics.Effect, turn: float) -> float:
        f = force(path(3e-5, -3e-5, -3e-5 + turn, -3e-5 + turn - 2e-7), *effects)
        return float(f[-5] - f[-1])

    turns = (2e-6, 6e-6, 3e-5)  # at which up to the level is reached
    alike = [back(turn=t) for t in turns]
    np.testing.assert_allclose(alike, alike[0], rtol=1e-9)
    bent = [back(softer(0.8), turn=t) for t in turns]
    assert bent[1] > 1.1 * bent[2] and bent[2] == pytest.approx(alike[0], rel=1e-6)


corners = st.lists(st.floats(-6e-6, 6e-6), min_size=1, max_size=8)
kinds = st.one_of(st.floats(-0.9, 0.9).map(closing), st.floats(-0.9, 9.0).map(softer))


@settings(max_examples=100, deadline=None)
@given(corners, kinds, st.floats(0.02, 0.95))
def test_every_loop_closes_that_does_not_reach_the_turn_before(
    places: list[float], bend: physics.Effect, part: float
) -> None:
    turns = [3e-5, -3e-5, *places]
    assume(abs(turns[-1] - turns[-2]) > 1e-8)
    before = path(*turns)
    back_and_forth = np.concatenate([np.linspace(0, 1, 60), np.linspace(1, 0, 60)])
    loop = before[-1] + part * (turns[-2] - turns[-1]) * back_and_forth
    f = force(np.concatenate([before, loop, loop]), bend) / LEVEL
    for end in (before.size + loop.size - 1, before.size + 2 * loop.size - 1):
        assert f[end] == pytest.approx(f[before.size - 1], abs=1e-9)
    assert np.abs(f).max() <= 1.0 + 1e-12


@settings(max_examples=40, deadline=None)
@given(corners, kinds)
def test_small_loops_that_closed_are_forgotten(places: list[float], bend: physics.Effect) -> None:
    """Wiping-out: after a return over it, what came between is gone."""
    outer = path(3e-5, -1e-5, 4e-6, -2e-6)
    inner = np.array([p * 0.2 for p in places])
    direct = np.concatenate([outer, outer[-1] + path(5e-6)])
    between = [outer[-1] + 1.5e-6 + 1.2e-6 * np.tanh(p / 1e-6) for p in inner]
    wander = np.concatenate([outer, outer[-1] + path(*(b - outer[-1] for b in between), 5e-6)])
    assert force(wander, bend)[-1] == pytest.approx(force(direct, bend)[-1], abs=1e-9 * LEVEL)


def taken(places: list[float], bend: physics.Effect, part: float) -> float:
    """Return the energy that the second of two loops takes, over the level times the length of the loop."""
    before = path(3e-5, -3e-5, *places)
    way, size = 1.0 if before[-1] < before[-2] else -1.0, part * 6e-6
    loop = before[-1] + way * size * np.concatenate([np.linspace(0, 1, 200), np.linspace(1, 0, 200)])
    x = np.concatenate([before, loop, loop])
    f = force(x, bend)
    last = slice(x.size - loop.size, None)
    return float(np.sum(np.diff(x[last]) * 0.5 * (f[last][1:] + f[last][:-1]))) / (LEVEL * size)


@settings(max_examples=40, deadline=None)
@given(corners, st.floats(-1.0, 9.0), st.floats(0.1, 0.9))
@example([0.0], -0.25, 0.25)
def test_loops_that_soften_dissipate(places: list[float], softening: float, part: float) -> None:
    assert taken(places, softer(softening), part) >= -1e-9


@settings(max_examples=40, deadline=None)
@given(corners, st.floats(-0.9, 0.9), st.floats(0.1, 0.9))
@example([2e-6], -0.3, 0.325)
def test_loops_that_differ_by_direction_give_next_to_no_energy(
    places: list[float], asymmetry: float, part: float
) -> None:
    """A branch that is flatter one way than the model's own gives back a little, of second order."""
    assert taken(places, closing(asymmetry), part) >= -2e-3 * asymmetry**2 - 1e-9


def test_more_reversals_than_are_kept_lose_the_smallest_loops_only() -> None:
    sizes = 4e-6 * 0.95 ** np.arange(4 * DEPTH)
    spiral = [3e-5, *(s * (-1.0) ** k for k, s in enumerate(sizes))]
    f = force(path(*spiral, 3e-5, step=2e-8), closing(0.3)) / LEVEL
    assert np.abs(f).max() <= 1.0
    assert f[-1] == 1.0


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), kinds)
def test_rounding_at_rest_changes_nothing(seed: int, bend: physics.Effect) -> None:
    """Where a level is another at each step the held part of it jitters by its last digits."""
    before = path(3e-5, -1e-5, 2e-6)
    random = np.random.default_rng(seed)
    still = before[-1] * (1.0 + 4e-16 * random.integers(-2, 3, 400))
    f = force(np.concatenate([before, still]), bend)
    np.testing.assert_allclose(f[before.size :], f[before.size - 1], atol=1e-9 * LEVEL)


def test_a_kind_between_the_two_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"closing is 0\.5; allowed is 0 or 1"):
        physics.build({"name": "asymmetric-friction", "asymmetry": 0.1, "closing": 0.5})
