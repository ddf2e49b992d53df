"""A refusal is one line, of exactly one kind, and names what it is about."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import pytest

from rtcomp.errors import RtcompError


def in_one_line(kind: type[RtcompError], words: Iterable[object], action: Callable[[], object]) -> str:
    """Expect that `action` is refused so, with all of `words` in the line; return it."""
    with pytest.raises(RtcompError) as caught:
        action()
    text = str(caught.value)
    assert type(caught.value) is kind, text
    assert "\n" not in text
    for word in words:
        assert str(word) in text, f"{word!r} is not in {text!r}"
    return text
