"""Grids of start values: which points are left out."""

from __future__ import annotations

import itertools
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.diagnosis.numerics.grids import chessboard


@given(st.lists(st.integers(1, 5), min_size=1, max_size=3))
def test_every_point_of_a_grid_is_looked_at_or_all_its_neighbours_are(sizes: list[int]) -> None:
    found = set(chessboard([[float(i) for i in range(size)] for size in sizes], range(len(sizes))))
    for point in itertools.product(*(range(size) for size in sizes)):
        steps = [np.eye(len(sizes), dtype=int)[i] * way for i in range(len(sizes)) for way in (-1, 1)]
        beside = [tuple(np.add(point, step)) for step in steps]
        inside = [at for at in beside if all(0 <= k < n for k, n in zip(at, sizes, strict=True))]
        assert point in found or found.issuperset(inside)
    assert len(found) == (math.prod(sizes) + 1) // 2


@given(st.lists(st.integers(1, 5), min_size=1, max_size=3))
def test_of_what_is_not_thinned_every_value_stands_beside_all_others(sizes: list[int]) -> None:
    grids = [[float(i) for i in range(size)] for size in sizes]
    rest = chessboard(grids[1:], range(len(sizes) - 1))
    assert set(chessboard(grids, range(1, len(sizes)))) == {(v, *one) for v in grids[0] for one in rest}
