"""How elements of friction yield: stops, Dahl's solid, and the closed form between them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp import physics
from rtcomp.physics.rows import motion_rows, over_rows
from rtcomp.physics.wires import FRICTION
from rtcomp.physics.yielding import stretched, yielded

moves = st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=20)


@settings(deadline=None)
@given(moves=moves, reach=st.floats(0.1, 2.0))
def test_of_exponent_0_it_is_a_stop(moves: list[float], reach: float) -> None:
    one = other = 0.0
    for moved in moves:
        one, other = yielded(one, moved, reach, 0.0), stretched(other, moved, reach)
        assert one == other


@settings(max_examples=50, deadline=None)
@given(moves=moves, exponent=st.sampled_from([0.5, 1.0, 1.5, 2.0]), parts=st.integers(2, 9))
def test_in_parts_it_goes_where_it_goes_at_once(moves: list[float], exponent: float, parts: int) -> None:
    one = other = 0.0
    for moved in moves:
        one = yielded(one, moved, 0.7, exponent)
        for _ in range(parts):
            other = yielded(other, moved / parts, 0.7, exponent)
        assert other == pytest.approx(one, abs=1e-9)
        assert abs(one) <= 0.7


def test_from_sliding_back_it_nears_the_other_level_exponentially() -> None:
    held = yielded(0.0, 100.0, 0.5, 1.0)
    assert held == pytest.approx(0.5)
    assert yielded(held, -0.3, 0.5, 1.0) == pytest.approx(-0.5 + 1.0 * math.exp(-0.3 / 0.5))


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_one_element_is_dahls_model(exponent: float) -> None:
    x = np.cumsum(np.random.default_rng(1).normal(0.0, 2e-6, 400))
    bank = physics.maxwell_slip.MaxwellSlip([(5e5, 4e-6)], exponent=exponent)
    model = physics.build({"name": "dahl", "stiffness": 5e5, "coulomb": 2.0, "exponent": exponent})
    rows = (over_rows([effect], motion_rows(x, 1e-3))[:, FRICTION] for effect in (bank, model))
    np.testing.assert_allclose(*rows, rtol=1e-9, atol=1e-12)
