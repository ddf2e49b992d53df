"""Blocks of the recordings: how many there are, and which are kept for the final judgement."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from rtcomp.diagnosis.recordings.data import reversals
from rtcomp.diagnosis.settings import BLOCK_REVERSALS, BLOCK_SECONDS, RESERVED_EVERY

if TYPE_CHECKING:
    from rtcomp.diagnosis.forces.balance import ForceBalance

LEAST_FORCE = 0.01
"""Part of the drive's force (rms) that blocks must have to judge by."""
FEWEST, MOST = 10, 25
"""Blocks of a recording: at least, at most."""


def cut(balance: ForceBalance) -> tuple[np.ndarray, np.ndarray]:
    """Return the block of each compared row, (n,), and which blocks are reserved, (blocks,) bool."""
    time = balance.plain([s.time for s in balance.data.segments])
    turns = sum(reversals(s.position) for s in balance.data.segments)
    count = min(balance.data.seconds / BLOCK_SECONDS, turns / BLOCK_REVERSALS if turns else np.inf)
    blocks = int(np.clip(count, FEWEST, MOST))
    block = np.arange(time.size) * blocks // time.size
    stepped = {int(block[np.argmin(np.abs(time - j.time))]) for j in balance.data.jumps}
    return block, reserved_blocks(blocks, stepped, _still(balance, block), _furthest(balance, block))


def _still(balance: ForceBalance, block: np.ndarray) -> set[int]:
    """Return the blocks in which the drive's force hardly varies: they judge nothing."""
    force = balance.drive_force()
    least = LEAST_FORCE * float(np.std(force))
    return {k for k in range(int(block[-1]) + 1) if float(np.std(force[block == k])) < least}


def _furthest(balance: ForceBalance, block: np.ndarray) -> set[int]:
    """Return the blocks in which command, position and speed are lowest and highest."""
    signals = [
        [s.voltage for s in balance.data.segments],
        [s.position for s in balance.data.segments],
        [p.v for p in balance.paths()],
    ]
    return {int(block[at(balance.plain(s))]) for s in signals for at in (np.argmin, np.argmax)}


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
