"""Work shared among the processor's cores: kernels run without Python's lock, so threads do.

Whoever calls `shared` works too and takes an idle helper along where there is one; a helper that calls it
finds none idle and goes on alone. So every level of a search may ask, the outermost gets the cores, and an
inner one those that the outer leaves idle.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from typing import TypeVar

from numba import config

from rtcomp.interrupts import signals_wait

FEW = 2e7
"""Floating-point operations that take about as long as to hand work over and to wait for it: 1 ms or two."""

Item = TypeVar("Item")
Found = TypeVar("Found")


class _Helpers:
    """Threads for all cores but the caller's, and how many of them are idle.

    A plain lock and a number: an interrupt in the middle of a Semaphore leaves it locked.
    """

    def __init__(self, count: int) -> None:
        self._lock = threading.Lock()
        self._idle = count
        self.pool = ThreadPoolExecutor(max(count, 1), thread_name_prefix="rtcomp-diagnosis")

    def take(self) -> bool:
        """Take one along, if one is idle."""
        with self._lock:
            if not self._idle:
                return False
            self._idle -= 1
            return True

    def give_back(self) -> None:
        """Say that one is idle again."""
        with self._lock:
            self._idle += 1


@cache
def _helpers() -> _Helpers:
    # As many as numba would use: the cores that this process may run on, or NUMBA_NUM_THREADS.
    return _Helpers(int(config.NUMBA_NUM_THREADS) - 1)


def shared(
    function: Callable[[Item], Found],
    items: Iterable[Item],
    done: Callable[[float], None] | None = None,
    *,
    operations: float = math.inf,
) -> list[Found]:
    """Return ``[function(i) for i in items]``, worked out on all cores that are idle.

    Of few floating-point `operations` in all no part is handed over: that would take longer than to do it.
    `function` must be pure, or change nothing but what it remembers. `done` hears the part that is done,
    always in the calling thread. The first exception is raised, by the order of the items.
    """
    all_items = list(items)
    if operations < FEW and done is None:
        return [function(item) for item in all_items]
    found: dict[int, Found] = {}
    failed: dict[int, BaseException] = {}
    left = iter(enumerate(all_items))
    lock = threading.Lock()
    helpers = _helpers()

    def leave_the_rest() -> None:
        with lock:
            for _ in left:
                pass

    def work(say: Callable[[float], None] | None) -> None:
        for at, item in _taken(left, lock):
            try:
                found[at] = function(item)
            except BaseException as error:  # raised below, in the calling thread
                failed[at] = error
                leave_the_rest()
            if say is not None:
                say((len(found) + len(failed)) / len(all_items))

    def help_out() -> None:
        try:
            work(None)
        finally:
            helpers.give_back()

    at_work: list[Future[None]] = []
    while len(at_work) < len(all_items) - 1 and helpers.take():
        with signals_wait():
            at_work.append(helpers.pool.submit(help_out))
    try:
        work(done)
    finally:
        leave_the_rest()  # an interrupt or `done` may have ended the caller's part
        if at_work:
            with signals_wait():
                for helper in at_work:
                    helper.result()
    if failed:
        raise failed[min(failed)]
    return [found[at] for at in range(len(all_items))]


def _taken(left: Iterator[Item], lock: threading.Lock) -> Iterator[Item]:
    """Take one after the other from what is left, whoever else does so too."""
    while True:
        with lock:
            item = next(left, None)
        if item is None:
            return
        yield item
