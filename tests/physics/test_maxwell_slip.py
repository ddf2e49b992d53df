"""Maxwell-slip banks: the rules of Masing, wiping-out, congruency, dissipation, and invariance in time."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.physics.rows import motion_rows, over_rows
from rtcomp.physics.wires import FRICTION, REACH, SCALE, VELOCITY

BANK = MaxwellSlip([(8e5, 1e-6), (4e5, 3e-6), (2e5, 7e-6)])
MICROMETRES = st.floats(-10e-6, 10e-6)
PATHS = st.lists(MICROMETRES, min_size=1, max_size=12)


def force(positions, bank=BANK, step=1e-3):
    """Force at each of `positions`, reached one after the other from rest at 0."""
    return over_rows([bank], motion_rows(np.array(positions, dtype=float), step))[:, FRICTION]


def virgin(x, bank=BANK):
    return np.sign(x) * sum(k * np.minimum(np.abs(x), r) for k, r in bank.elements)


def test_virgin_curve_is_the_sum_of_the_elements():
    x = np.linspace(0, 10e-6, 101)
    np.testing.assert_allclose(force(x), virgin(x), rtol=1e-12, atol=1e-12)


@settings(deadline=None)
@given(turn=st.floats(0.1e-6, 10e-6), back=st.floats(0.0, 1.0))
def test_masing_branches_are_the_virgin_curve_doubled(turn, back):
    target = turn - 2 * turn * back
    expected = virgin(turn) - 2 * virgin((turn - target) / 2)
    assert force([turn, target])[-1] == pytest.approx(expected, abs=1e-9)


@settings(deadline=None)
@given(path=PATHS, inner=st.lists(st.floats(0, 1), min_size=1, max_size=5))
def test_wiping_out_a_closed_inner_loop_leaves_nothing(path, inner):
    low, high = min([0.0, *path]), max([0.0, *path])
    outer = [high, low - 1e-6]
    loop = [low - 1e-6 + f * (high - low) for f in inner]
    after = [low - 1e-6, low - 3e-6, high]
    assert force([*path, *outer, *loop, *after])[-1] == pytest.approx(
        force([*path, *outer, *after])[-1], abs=1e-9
    )


@settings(deadline=None)
@given(one=PATHS, other=PATHS, low=st.floats(-4e-6, 0), size=st.floats(0.2e-6, 4e-6))
def test_congruency_loops_between_the_same_turning_points_have_the_same_shape(one, other, low, size):
    loop = [low, low + size, *np.linspace(low + size, low, 9), *np.linspace(low, low + size, 9)]
    first, second = force([*one, *loop])[-18:], force([*other, *loop])[-18:]
    np.testing.assert_allclose(first - first[0], second - second[0], atol=1e-9)


@settings(deadline=None)
@given(path=PATHS)
def test_a_closed_loop_dissipates(path):
    corners = np.array([*path, *path, path[0]])
    fine = np.concatenate([np.linspace(a, b, 40)[1:] for a, b in pairwise(corners)])
    f = force([path[0], *fine])
    x = np.concatenate([[path[0]], fine])
    start = len(fine) // 2 if len(path) > 1 else 0  # the second turn: closed in state as well
    x, f = x[start:], f[start:]
    assert np.sum(np.diff(x) * (f[1:] + f[:-1]) / 2) >= -0.02 * BANK.level * 1e-6


@settings(deadline=None)
@given(path=PATHS, factor=st.floats(1e-3, 1e3))
def test_rate_independent(path, factor):
    assert force(path, step=1e-3).tolist() == force(path, step=1e-3 * factor).tolist()


@settings(deadline=None)
@given(path=PATHS, pieces=st.integers(2, 30))
def test_splitting_a_displacement_changes_nothing(path, pieces):
    corners = [0.0, *path]
    fine = [a + (b - a) * (j + 1) / pieces for a, b in pairwise(corners) for j in range(pieces)]
    np.testing.assert_allclose(force(fine)[pieces - 1 :: pieces], force(path), atol=1e-9)


def test_a_stiff_element_is_right_at_a_coarse_step():
    """1e8 N/m at 20 us, where an explicit integration is 27 times wrong."""
    bank = MaxwellSlip([(1e8, 5e-8)])
    t = np.arange(1, 1001) * 20e-6
    x = 2e-6 * np.sin(2 * np.pi * 50 * t)
    coarse = force(x, bank)
    fine_t = np.arange(1, 100_001) * 20e-8
    fine = force(2e-6 * np.sin(2 * np.pi * 50 * fine_t), bank)[99::100]
    assert np.max(np.abs(coarse)) == pytest.approx(5.0)
    # They differ only where a reversal falls between two coarse rows.
    assert np.mean(np.abs(coarse - fine) > 1e-6) < 0.03


@settings(max_examples=30, deadline=None)
@given(reach=st.floats(0.1, 5), scale=st.floats(0.1, 5), x=MICROMETRES)
def test_reach_widens_and_scale_multiplies(reach, scale, x):
    rows = motion_rows(np.array([x]), 1e-3)
    rows[:, REACH], rows[:, SCALE] = reach, scale
    over_rows([BANK], rows)
    wider = MaxwellSlip([(k, r * reach) for k, r in BANK.elements])
    assert rows[0, FRICTION] == pytest.approx(scale * force([x], wider)[0], abs=1e-12)


def test_holds_at_rest():
    rows = motion_rows(np.array([3e-6] * 100), 1e-3)
    rows[1:, VELOCITY] = -0.0
    assert len(set(over_rows([BANK], rows)[:, FRICTION])) == 1


@pytest.mark.parametrize(
    ("elements", "says"),
    [
        ([], "empty"),
        ([{"stiffness": 1e5}], r"friction\[0\].*'reach' \(m\) is missing"),
        (
            [{"stiffness": 1e5, "reach": 1e-6}, {"stiffness": 1e5, "reach": 0.0}],
            r"friction\[1\]: reach is 0 m",
        ),
        ([{"stiffness": 1e5, "reach": 1e-6, "stifness": 1}], "unknown parameter 'stifness'"),
        ([{"stiffness": "soft", "reach": 1e-6}], "'soft'; it must be a number"),
        ([7], r"friction\[0\] is 7"),
        ("elements", "must be a list"),
    ],
)
def test_a_wrong_list_is_refused_with_its_place(elements, says):
    with pytest.raises(ConfigError, match=says) as caught:
        MaxwellSlip.from_dict({"elements": elements})
    assert "\n" not in str(caught.value)
