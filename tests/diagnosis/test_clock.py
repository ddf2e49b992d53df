"""The clock of a budget stands still while something is compiled, and only then."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest
from numba import cfunc, njit, types

from rtcomp.diagnosis import clock


def passed(work: Callable[[], object]) -> tuple[float, float, float]:
    """Seconds on the wall, on the clock within these, and of compiling, while `work()` was done."""
    wall, compiled, own = time.monotonic(), clock.compiling(), clock.now()
    work()
    own, compiled = clock.now() - own, clock.compiling() - compiled
    return time.monotonic() - wall, own, compiled


def compile_one() -> None:
    njit(lambda x: x + 1.0)(2.0)


def compile_a_callback() -> None:
    cfunc(types.float64(types.float64))(lambda x: 3.0 * x)


def compile_in_two_threads() -> None:
    threads = [threading.Thread(target=compile_one) for _ in range(2)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()


@pytest.mark.parametrize("work", [compile_one, compile_a_callback, compile_in_two_threads])
def test_it_stands_still_while_something_is_compiled(work: Callable[[], object]) -> None:
    wall, own, compiled = passed(work)
    assert compiled > 0.0
    assert 0.0 <= own <= wall - compiled + 1e-9  # threads that compile by turns are counted once


def test_it_goes_on_otherwise() -> None:
    wall, own, compiled = passed(lambda: time.sleep(0.05))
    assert compiled == 0.0
    assert 0.05 <= own <= wall


def test_a_budget_is_counted_from_where_it_began() -> None:
    before = clock.now()
    ends, earlier = clock.ends_at(60.0), clock.ends_at(60.0, time.monotonic() - 50.0)
    after = clock.now()
    assert before + 60.0 <= ends <= after + 60.0
    assert earlier <= after + 10.0 and earlier >= before + 10.0 - (after - before) - 1e-9
