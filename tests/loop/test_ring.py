from __future__ import annotations

import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.loop.ring import LOST, Ring


def write(ring: Ring, rows: int) -> None:
    from rtcomp.loop.push import push

    for _ in range(rows):
        push(ring.header, ring.rows, np.full(ring.rows.shape[1], float(ring.written)))


@settings(max_examples=50, deadline=None)
@given(
    st.integers(2, 40),
    st.lists(st.tuples(st.integers(0, 60), st.one_of(st.none(), st.integers(1, 30))), max_size=12),
)
def test_every_row_is_taken_once_in_order_or_counted_as_lost(
    capacity: int, steps: list[tuple[int, int | None]]
) -> None:
    ring = Ring.create(capacity, 3)
    taken: list[float] = []
    for rows, most in steps:
        write(ring, rows)
        got = ring.take() if most is None else ring.take(most)
        assert np.all(got == got[:, :1])
        taken.extend(got[:, 0])
    ring.close()
    while ring.waiting:
        taken.extend(ring.take()[:, 0])
    assert taken == sorted(set(taken))
    assert len(taken) + ring.header[LOST] == ring.written
    if max((rows for rows, _ in steps), default=0) * len(steps) < capacity:
        assert ring.header[LOST] == 0
    ring.release()


def test_only_the_overwritten_are_lost() -> None:
    ring = Ring.create(100, 1)
    write(ring, 130)
    # One more than 30: the oldest that is left could be under the writer's hand at this moment.
    assert np.array_equal(ring.take()[:, 0], np.arange(31.0, 130.0))
    assert ring.header[LOST] == 31
    write(ring, 130)
    ring.close()
    assert np.array_equal(ring.take()[:, 0], np.arange(160.0, 260.0))
    ring.release()


def test_it_is_shared_through_its_descriptor() -> None:
    ring = Ring.create(16, 2)
    other = Ring.attach(os.dup(ring.descriptor))
    write(ring, 3)
    assert np.array_equal(other.take()[:, 1], [0.0, 1.0, 2.0])
    assert ring.waiting == 0
    other.release()
    ring.release()
    ring.release()
    assert ring.descriptor == -1
    with pytest.raises(ValueError, match="not a ring"):
        memory = os.memfd_create("stranger")
        os.ftruncate(memory, 4096)
        Ring.attach(memory)
    os.close(memory)
