"""What is believed of coefficients: near it as Gauss has it, and no weight of a guess that is far off."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.diagnosis.numerics.regression import Grams, Prior

COUNT, SD = 400, 0.2


def problem(seed: int, true: float) -> tuple[Grams, Prior, float]:
    """One column that is believed to be 1 +- 0.2, one that is not, and noise."""
    random = np.random.default_rng(seed)
    columns = random.normal(size=(2, COUNT))
    y = true * columns[0] + 3.0 * columns[1] + random.normal(size=COUNT)
    free = np.full(2, np.inf)
    prior = Prior(np.array([1.0, 0.0]), np.array([SD**-2, 0.0]), -free, free)
    plain = float(np.linalg.lstsq(columns.T, y, rcond=None)[0][0])
    return Grams.of(columns, y, np.zeros(COUNT, dtype=np.int64), 1), prior, plain


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 1000), true=st.floats(0.8, 1.2))
def test_near_the_belief_it_is_a_prior_of_gauss(seed: int, true: float) -> None:
    grams, prior, plain = problem(seed, true)
    use = np.ones(1, dtype=np.bool_)
    gauss = grams.solve(use, prior, 1.0)
    at, found = grams.relaxed(use, prior, 1.0)
    assert found[0] == pytest.approx(gauss[0], abs=0.1 * abs(plain - 1.0) + 1e-6)
    np.testing.assert_allclose(grams.solve(use, at, 1.0), found, rtol=1e-3)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 1000), true=st.floats(10.0, 60.0))
def test_a_guess_that_is_far_off_has_no_weight(seed: int, true: float) -> None:
    grams, prior, plain = problem(seed, true)
    use = np.ones(1, dtype=np.bool_)
    assert grams.solve(use, prior, 1.0)[0] < plain - 0.2
    assert grams.relaxed(use, prior, 1.0)[1][0] == pytest.approx(plain, abs=0.01)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 1000), true=st.floats(0.0, 1.0))
def test_what_is_smaller_is_held_as_gauss_has_it(seed: int, true: float) -> None:
    grams, prior, plain = problem(seed, true)
    use = np.ones(1, dtype=np.bool_)
    if plain < 1.0:
        assert grams.relaxed(use, prior, 1.0)[1][0] == pytest.approx(
            grams.solve(use, prior, 1.0)[0], abs=1e-9
        )
