"""What is remembered is what would be made anew, and never more than so much."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

from hypothesis import given
from hypothesis import strategies as st

from rtcomp.diagnosis.remembered import Remembered


@given(st.lists(st.integers(0, 9), max_size=60), st.integers(1, 5))
def test_it_is_made_only_where_it_was_not_asked_for_lately(asked: list[int], most: int) -> None:
    memory: Remembered[int] = Remembered(most)
    made: list[int] = []

    def make(key: int) -> int:
        made.append(key)
        return key * key

    lately: list[int] = []
    for key in asked:
        before = len(made)
        assert memory.of(key, lambda key=key: make(key)) == key * key  # type: ignore[misc]
        assert (len(made) == before) == (key in lately)
        lately = [*(k for k in lately if k != key), key][-most:]


def test_threads_may_ask_for_the_same() -> None:
    memory: Remembered[int] = Remembered(2)
    with ThreadPoolExecutor(4) as pool:
        asked = [i % 3 for i in range(3000)]
        assert list(pool.map(lambda key: memory.of(key, lambda: key + 1), asked)) == [k + 1 for k in asked]
