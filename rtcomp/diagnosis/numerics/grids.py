"""Grids of start values in several numbers at once."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence

Point = tuple[float, ...]
"""A value of each number."""


def chessboard(grids: Sequence[Sequence[float]], thinned: Collection[int]) -> list[Point]:
    """Return a grid, of numbers `thinned` every second point: of those left out all neighbours are there."""
    places = itertools.product(*(range(len(grid)) for grid in grids))
    black = (at for at in places if sum(at[i] for i in thinned) % 2 == 0)
    return [tuple(g[i] for g, i in zip(grids, at, strict=True)) for at in black]
