"""Blocks of a recording: which are reserved."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.diagnosis.forces.blocks import reserved_blocks


@given(st.integers(10, 25), st.sets(st.integers(0, 24)), st.sets(st.integers(0, 24)))
def test_one_block_of_five_is_reserved_but_none_that_is_unlike_the_others(
    count: int, stepped: set[int], furthest: set[int]
) -> None:
    found = reserved_blocks(count, stepped, furthest)
    assert found.any()
    unlike = stepped | furthest
    if set(range(count - count % 5)) - unlike:
        assert not unlike & set(np.flatnonzero(found).tolist())
        for first in range(0, count - 2, 5):
            group = set(range(first, min(first + 5, count)))
            assert found[sorted(group)].sum() == bool(group - unlike)
