"""Statistics of columns: what is added to them is as if all had been gathered at once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.diagnosis.numerics.regression import Grams

ROWS = 40


@given(st.integers(1, 4), st.integers(0, 3), st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_extended_statistics_are_those_of_all_columns(p: int, q: int, blocks: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    columns, more = random.standard_normal((p, ROWS)), random.standard_normal((q, ROWS))
    y, block = random.standard_normal(ROWS), np.sort(random.integers(0, blocks, ROWS))
    found = Grams.of(columns, y, block, blocks).extended(columns, more, y, block)
    whole = Grams.of(np.concatenate([columns, more]), y, block, blocks)
    for name in ("gram", "cross", "power", "rows"):
        assert getattr(found, name) == pytest.approx(getattr(whole, name), abs=1e-12)
