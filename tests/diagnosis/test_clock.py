"""The clock of a budget stands still while something is compiled, and only then."""

from __future__ import annotations

import threading
import time

import pytest
from numba import cfunc, njit, types

from rtcomp.diagnosis import clock


def passed(work: object) -> tuple[float, float]:
    """Seconds that went by on the wall and on the clock while `work()` was done."""
    wall, own = time.monotonic(), clock.now()
    work()  # type: ignore[operator]
    return time.monotonic() - wall, clock.now() - own


def compile_one() -> None:
    njit(lambda x: x + 1.0)(2.0)


def compile_a_callback() -> None:
    cfunc(types.float64(types.float64))(lambda x: 3.0 * x)


@pytest.mark.parametrize("work", [compile_one, compile_a_callback])
def test_it_stands_still_while_something_is_compiled(work: object) -> None:
    wall, own = passed(work)
    assert 0.0 <= own < 0.5 * wall


def test_two_threads_that_compile_are_counted_once() -> None:
    def both() -> None:
        threads = [threading.Thread(target=compile_one) for _ in range(2)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()

    before = clock.compiling()
    wall, own = passed(both)
    assert clock.compiling() - before <= wall
    assert own >= 0.0


def test_it_goes_on_otherwise() -> None:
    wall, own = passed(lambda: time.sleep(0.05))
    assert own == pytest.approx(wall, abs=1e-3)


def test_a_budget_is_counted_from_where_it_began() -> None:
    assert clock.ends_at(60.0) - clock.now() == pytest.approx(60.0, abs=0.5)
    assert clock.ends_at(60.0, time.monotonic() - 50.0) - clock.now() == pytest.approx(10.0, abs=0.5)
