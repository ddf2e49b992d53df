"""The tick's kernel with its arrays taken by address once.

To hand the thirty arrays of a loop over from Python costs 3 us each time, twice what the tick takes. They
stay where they are from the first tick to the last, so their addresses are written into a table beforehand,
and a call hands over that and the plan's row.
"""

from __future__ import annotations

import numba
import numpy as np

from rtcomp.kernels import Floats, compiled, floats_at, integers_at
from rtcomp.loop.kernel import Compensator, Identifier, tick_kernel

_ENTRY = 3
"""Numbers of the table for each argument: an address, or a number itself; rows; columns."""


@compiled
def _integer(table: np.ndarray, k: int) -> int:
    return int(table[_ENTRY * k])


@compiled
def _numbers(table: np.ndarray, k: int) -> Floats:
    numbers: Floats = numba.carray(floats_at(table[_ENTRY * k]), table[_ENTRY * k + 1])
    return numbers


@compiled
def _rows(table: np.ndarray, k: int) -> Floats:
    shape = (table[_ENTRY * k + 1], table[_ENTRY * k + 2])
    rows: Floats = numba.carray(floats_at(table[_ENTRY * k]), shape)
    return rows


@compiled
def _tick_at(table: np.ndarray, plan: Floats) -> float:
    """Run `tick_kernel` on the arrays in `table`, in the order of its arguments and their fields."""
    identifier = Identifier(
        _integer(table, 0), _numbers(table, 1), _numbers(table, 2), _numbers(table, 3),
        _integer(table, 4), _numbers(table, 5), _numbers(table, 6), _numbers(table, 7),
        _rows(table, 8), _rows(table, 9), _rows(table, 10),
        _numbers(table, 11), _numbers(table, 12), _numbers(table, 13),
        _integer(table, 14), _numbers(table, 15), _numbers(table, 16), _integer(table, 17),
    )  # fmt: skip
    compensator = Compensator(
        _numbers(table, 18), _numbers(table, 19), _numbers(table, 20), _numbers(table, 21),
        _numbers(table, 22), _numbers(table, 23),
    )  # fmt: skip
    header = numba.carray(integers_at(table[_ENTRY * 27]), table[_ENTRY * 27 + 1])
    return tick_kernel(
        plan, identifier, compensator, _numbers(table, 24), _numbers(table, 25), _numbers(table, 26),
        header, _rows(table, 28),
    )  # fmt: skip


class BoundTick:
    """The kernel of one loop: called with a row of the plan, it returns the command (V)."""

    def __init__(
        self, identifier: Identifier, compensator: Compensator, settings: Floats, state: Floats, row: Floats,
        header: np.ndarray, rows: Floats,
    ) -> None:  # fmt: skip
        self._held = (*identifier, *compensator, settings, state, row, header, rows)
        entries = [_entry(part) for part in self._held]
        self._table = np.array(entries, dtype=np.int64).reshape(-1)

    def __call__(self, plan: Floats) -> float:
        """Run one tick; as `tick_kernel`."""
        return float(_tick_at(self._table, plan))


def _entry(part: np.ndarray | int) -> tuple[int, int, int]:
    if not isinstance(part, np.ndarray):
        return part, 0, 0
    if not part.flags.c_contiguous:
        raise ValueError("the tick's arrays must be contiguous")
    return part.ctypes.data, part.shape[0], part.shape[1] if part.ndim == 2 else 1
