"""Work that is shared among cores comes out as if one had done it."""

from __future__ import annotations

import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtcomp.diagnosis import cores
from rtcomp.diagnosis.cores import shared


@pytest.fixture(autouse=True, params=[0, 1, 3])
def helpers(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """So many helpers, whatever this computer has."""
    own = cores._Helpers(request.param)
    monkeypatch.setattr(cores, "_helpers", lambda: own)
    return int(request.param)


@given(st.lists(st.integers(), max_size=40))
def test_results_come_in_the_order_of_the_items(items: list[int]) -> None:
    assert shared(lambda i: i * i, items) == [i * i for i in items]


def test_few_operations_are_done_by_the_caller_alone() -> None:
    threads = shared(lambda _: threading.get_ident(), range(50), operations=1e3)
    assert set(threads) == {threading.get_ident()}


def test_none_is_an_item_like_others() -> None:
    assert shared(lambda i: i, [None, 1, None]) == [None, 1, None]


def test_all_helpers_are_at_work_and_the_caller_too(helpers: int) -> None:
    together = threading.Barrier(helpers + 1, timeout=20.0)
    assert shared(lambda i: together.wait() >= 0, range(helpers + 1)) == [True] * (helpers + 1)


def test_sharing_within_shared_work_ends() -> None:
    def inner(i: int) -> int:
        return sum(shared(lambda j: i * j, range(5)))

    assert shared(inner, range(20)) == [10 * i for i in range(20)]


def test_helpers_come_free_again(helpers: int) -> None:
    for _ in range(5):
        shared(lambda i: i, range(4))
    deadline = time.monotonic() + 20.0
    free = 0
    while free < helpers and time.monotonic() < deadline:
        free += cores._helpers().take()
        time.sleep(0.01)
    assert free == helpers


def test_the_first_failure_by_order_is_raised_and_the_rest_left() -> None:
    tried: list[int] = []

    def fails(i: int) -> int:
        tried.append(i)
        if i >= 2:
            raise ValueError(f"item {i}")
        return i

    with pytest.raises(ValueError, match="item 2"):
        shared(fails, range(1000))
    assert len(tried) < 100
    assert shared(lambda i: i, [1, 2]) == [1, 2]  # and whoever helped is there again


def test_what_ends_the_caller_ends_the_others_too() -> None:
    tried: list[int] = []

    def stop(_part: float) -> None:
        raise KeyboardInterrupt

    def slow(i: int) -> None:
        tried.append(i)
        time.sleep(0.002)

    with pytest.raises(KeyboardInterrupt):
        shared(slow, range(1000), stop)
    assert len(tried) < 100
    assert shared(lambda i: i, [1, 2]) == [1, 2]


def test_progress_is_heard_in_the_calling_thread_and_rises() -> None:
    heard: list[tuple[float, int]] = []
    shared(lambda i: time.sleep(0.001), range(30), lambda part: heard.append((part, threading.get_ident())))
    parts = [part for part, _ in heard]
    assert parts == sorted(parts) and parts and parts[-1] <= 1.0
    assert {thread for _, thread in heard} == {threading.get_ident()}
