"""The kernel by the addresses of its arrays is the kernel."""

from __future__ import annotations

import numpy as np
import pytest
from loop_rig import plan, tick

from rtcomp.loop import layout as at
from rtcomp.loop.bound import BoundTick
from rtcomp.loop.kernel import tick_kernel
from rtcomp.loop.ring import Ring


def rows_of(axis, bound):
    """A loop on positions that follow the reference roughly, with or without the table of addresses."""
    ring, table = Ring.create(400, axis.row_width), plan(400, share=1.0).table
    parts = (axis.identifier, axis.compensator, axis.settings, axis.state, axis.row, ring.header, ring.rows)
    run = BoundTick(*parts) if bound else lambda row: tick_kernel(row, *parts)
    volts = []
    for k, row in enumerate(table):
        axis.row[at.ROW_POSITION] = 0.9 * row[at.REFERENCE]
        axis.row[at.ROW_SEQUENCE] = k + 1.0
        volts.append(run(row))
    rows = ring.take()
    ring.release()
    return np.array(volts), rows, axis.weights.copy()


@pytest.mark.parametrize("smoothing", [0.0, 100.0])
def test_it_is_the_same_tick_to_the_last_bit(smoothing):
    left, right = (rows_of(tick(smoothing=smoothing), bound) for bound in (True, False))
    for one, other in zip(left, right, strict=True):
        assert np.array_equal(one, other) and one.any()


def test_arrays_that_are_not_contiguous_are_refused():
    axis, ring = tick(), Ring.create(4, 40)
    with pytest.raises(ValueError, match="must be contiguous"):
        BoundTick(
            axis.identifier,
            axis.compensator,
            axis.settings,
            axis.state,
            axis.row[::2],
            ring.header,
            ring.rows,
        )
    ring.release()


def test_it_holds_its_arrays():
    """Nothing else need hold them: an address outlives no array."""
    axis, ring = tick(), Ring.create(8, tick().row_width)
    bound = BoundTick(
        axis.identifier, axis.compensator, axis.settings, axis.state, axis.row, ring.header, ring.rows
    )
    axis.row[at.ROW_SEQUENCE] = 1.0
    state = axis.state
    del axis
    assert np.isfinite(bound(plan(16).table[0])) and state[at.STARTED] == 1.0
    ring.release()
