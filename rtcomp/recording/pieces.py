"""Long columns looked at piece by piece: an hour at 10 kHz is 36 million rows; its copies do not fit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Scalar = TypeVar("Scalar", bound=np.generic)

PIECE = 1 << 20
"""Rows of a piece."""
STRETCHES, STRETCH = 16, 1 << 16
"""How many stretches of how many rows stand for a long column where a median of all of it is meant."""


def pieces(rows: int) -> Iterator[slice]:
    """Cut `rows` rows into slices of PIECE or less, in order."""
    for begin in range(0, rows, PIECE):
        yield slice(begin, min(begin + PIECE, rows))


def steps(column: Floats) -> Iterator[tuple[int, Floats]]:
    """Go through the differences from row to row, (K - 1,) in all: the first's row, and a piece of them."""
    for part in pieces(len(column) - 1):
        yield part.start, np.diff(column[part.start : part.stop + 1])


def sample(column: npt.NDArray[Scalar]) -> list[npt.NDArray[Scalar]]:
    """Return all of a short column; of a long one stretches, evenly spread."""
    if len(column) <= STRETCHES * STRETCH:
        return [column]
    starts = np.linspace(0, len(column) - STRETCH, STRETCHES).astype(np.int64)
    return [column[start : start + STRETCH] for start in starts.tolist()]


def bridged(column: Floats, good: npt.NDArray[np.bool_]) -> Floats:
    """Return `column` (K,) with straight lines across the rows that are not `good` (K,); rows equally spaced.

    Before the first good row and after the last it stays at theirs. With nothing to bridge it is `column`.
    """
    if good.all() or not good.any():
        return column
    bad = np.flatnonzero(~good)
    beside = np.unique(np.concatenate([bad - 1, bad + 1]))
    beside = beside[(beside >= 0) & (beside < len(column))]
    beside = beside[good[beside]]
    out = column.copy()
    out[bad] = np.interp(bad, beside, column[beside])
    return out
