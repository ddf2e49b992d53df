"""Which blocks of the recordings are kept for the final judgement."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from rtcomp.diagnosis.settings import RESERVED_EVERY


def reserved_blocks(count: int, *unlike: Collection[int]) -> np.ndarray:
    """Return which of `count` blocks are reserved, (count,) bool: of every few the middle one, if it may be.

    Where that is `unlike` the others, the next that is not. Where no block would be left, the last of the
    reasons does not count.
    """
    found = np.zeros(count, dtype=np.bool_)
    besides = {block for some in unlike for block in some}
    middle = RESERVED_EVERY // 2
    for first in range(0, count - middle, RESERVED_EVERY):
        group = list(range(first, min(first + RESERVED_EVERY, count)))
        free = [b for b in group[middle:] + group[:middle] if b not in besides]
        found[free[:1]] = True
    return found if found.any() or not unlike else reserved_blocks(count, *unlike[:-1])
