"""A signal waits where it must, is handed on to the handler that stood before, and no handler is lost."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from types import FrameType

import pytest

from rtcomp.errors import Interrupted
from rtcomp.interrupts import signals_wait, stop_on_signals


def ends(number: int, _frame: FrameType | None) -> None:
    raise Interrupted(number)


@pytest.fixture(autouse=True)
def _ended_by_signals() -> Iterator[None]:
    before = {number: signal.signal(number, ends) for number in (signal.SIGTERM, signal.SIGINT)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def stands() -> bool:
    return all(signal.getsignal(number) is ends for number in (signal.SIGTERM, signal.SIGINT))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_waits_until_the_block_ends(number: int) -> None:
    after = False
    with pytest.raises(Interrupted) as interrupted, signals_wait():
        signal.raise_signal(number)
        after = True
    assert after and interrupted.value.number == number and stands()


def test_a_signal_is_handed_on_once() -> None:
    with signals_wait() as stop:
        stop.hand_on()
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(Interrupted) as interrupted:
            stop.hand_on()
        assert interrupted.value.number == signal.SIGTERM
        stop.hand_on()
    assert stands()


def test_an_error_in_the_block_comes_first() -> None:
    with pytest.raises(ValueError, match="mine"), signals_wait():
        signal.raise_signal(signal.SIGTERM)
        raise ValueError("mine")
    assert stands()


def test_a_block_within_a_block_lets_the_outer_one_decide() -> None:
    with stop_on_signals() as outer:
        with signals_wait():
            signal.raise_signal(signal.SIGTERM)
        assert outer.requested and outer.number == signal.SIGTERM
    assert stands()
