"""Generalised Maxwell-slip: its two laws, its limits, and the sign slip that makes others diverge."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.errors import ConfigError
from rtcomp.physics.gms import GeneralisedMaxwellSlip
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.physics.rows import motion_rows, over_rows
from rtcomp.physics.wires import FRICTION, STEP, VELOCITY

ELEMENTS = [(6e5, 0.3), (3e5, 0.5), (1e5, 0.2)]
SLIDING = {"coulomb": 3.0, "static": 4.0, "stribeck_velocity": 2e-3, "attraction": 60.0, "viscous": 5.0}

SIZES = st.floats(1e-9, 1e-4)


def force(positions, step=1e-3, **changes):
    effect = GeneralisedMaxwellSlip(ELEMENTS, **{**SLIDING, **changes})
    return over_rows([effect], motion_rows(np.array(positions, dtype=float), step))[:, FRICTION]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("speed", [1e-4, 2e-3, 0.05])
def test_settles_on_the_stribeck_curve(speed, sign):
    travel = sign * speed * 1e-3 * np.arange(1, 3001)
    level = 3.0 + math.exp(-((speed / 2e-3) ** 2))
    assert force(travel)[-1] == pytest.approx(sign * (level + 5.0 * speed), rel=1e-6)


def test_negative_strokes_mirror_positive_ones():
    """With s positive and an outer sgn(v) on the slip law it would diverge at the first negative stroke."""
    t = np.arange(1, 4001) * 1e-3
    x = 1e-3 * np.sin(2 * np.pi * t)
    np.testing.assert_allclose(force(-x), -force(x), rtol=1e-12)
    assert np.max(np.abs(force(x, viscous=0.0))) <= 4.0


@settings(deadline=None)
@given(path=st.lists(st.floats(-2e-5, 2e-5), min_size=1, max_size=12))
def test_with_one_level_it_is_the_maxwell_slip_bank(path):
    bank = MaxwellSlip([(k, weight * 3.0 / k) for k, weight in ELEMENTS])
    expected = over_rows([bank], motion_rows(np.array(path), 1e-3))[:, FRICTION]
    np.testing.assert_allclose(force(path, static=3.0, viscous=0.0), expected, atol=1e-9)


def test_slip_settles_with_the_attraction():
    """After a jump in speed all elements slip on towards the new level at C / s."""
    slow, fast, dt = 1e-4, 0.05, 1e-3
    x = np.concatenate([slow * dt * np.arange(1, 1001), slow * 1.0 + fast * dt * np.arange(1, 201)])
    f = force(x, viscous=0.0)[1000:]
    start = 3.0 + math.exp(-((slow / 2e-3) ** 2))
    t = dt * np.arange(1, 201)
    np.testing.assert_allclose(f, 3.0 + (start - 3.0) * np.exp(-60.0 * t / 3.0), rtol=1e-9)


def test_friction_is_higher_while_speeding_up_than_while_slowing_down():
    t = np.arange(1, 20001) * 1e-4
    v = 4e-3 + 3e-3 * np.sin(2 * np.pi * 5 * t)
    f = force(np.cumsum(v) * 1e-4, 1e-4, viscous=0.0)[-2000:]
    v = v[-2000:]
    up = np.gradient(v) > 0
    middle = np.abs(v - 4e-3) < 1e-3
    assert f[middle & up].mean() > f[middle & ~up].mean() + 0.02


@settings(deadline=None)
@given(
    # From a nanometre up, so that a piece of it does not vanish in the rounding of the position.
    moves=st.lists(st.tuples(SIZES | SIZES.map(lambda m: -m), st.integers(2, 15)), min_size=1, max_size=6),
)
def test_splitting_a_move_at_constant_speed_changes_nothing(moves):
    corners = np.cumsum([0.0] + [m for m, _ in moves])
    pieces = [n for _, n in moves]
    fine_step = 1e-3 / np.repeat(pieces, pieces)
    fine = np.concatenate(
        [np.linspace(a, b, n + 1)[1:] for a, b, n in zip(corners[:-1], corners[1:], pieces, strict=True)]
    )
    rows = motion_rows(fine, 1e-3)
    rows[:, STEP] = fine_step
    rows[:, VELOCITY] = np.repeat([m / 1e-3 for m, _ in moves], pieces)
    split = over_rows([GeneralisedMaxwellSlip(ELEMENTS, **SLIDING)], rows)[:, FRICTION]
    np.testing.assert_allclose(split[np.cumsum(pieces) - 1], force(corners[1:]), atol=1e-6)


def test_weights_must_sum_to_one():
    with pytest.raises(ConfigError, match=r"sum to 0\.9; they must sum to 1"):
        GeneralisedMaxwellSlip([(1e5, 0.5), (1e5, 0.4)], **SLIDING)
