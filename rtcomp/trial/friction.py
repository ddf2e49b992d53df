"""The trial's friction memory: branches between reversals after Madelung's rules, kept on a stack.

The normalised force h, -1 to 1, follows from a displacement xi by three rules: a reversal starts a branch
that heads for the reversal before it; where it arrives there, both are forgotten and the older branch goes
on; beyond the last one the contact slides with h = +-1. With one shape for all branches this is Masing's
rule, whose loops are those of the smooth virgin curve phi(u) = 1 - (1 - u)^m, finite at u = 1. Branches may
also differ by direction, or by the force they start at; the loops still close.
"""

from __future__ import annotations

import numpy as np

from rtcomp.kernels import Floats, compiled

ELEMENTS = 18
"""Stop elements that stand for smooth friction in a belief; they miss it by 0.15 % of the level at most."""
DEPTH = 256
"""Reversals remembered; the smallest loops are dropped beyond."""
XI, H, WAY, COUNT, SLID, FROM, AT = 0, 1, 2, 3, 4, 5, 6
"""Slots of the memory: displacement, force, direction, reversals kept, whether it ever slid, where the
branch began; then the reversals' places and forces."""


def fresh() -> Floats:
    """Return the memory of a contact that never moved."""
    return np.zeros(AT + 2 * DEPTH)


@compiled
def virgin(u: float, shape: float) -> float:
    """Return phi(u) for u >= 0."""
    return 1.0 if u >= 1.0 else 1.0 - (1.0 - u) ** shape


@compiled
def _turn(z: Floats, reach: float, other: float) -> None:
    """Keep the reversal at hand; `other` is the shape of the branch about to begin."""
    n = int(z[COUNT])
    if n == 0 and z[SLID] == 0.0:  # the virgin curve turns for its mirror image
        z[AT], z[AT + DEPTH] = -z[XI], -z[WAY] * virgin(abs(z[XI]) / reach, other)
        n = 1
    elif n >= DEPTH - 1:
        n -= 2
    z[AT + n], z[AT + DEPTH + n] = z[XI], z[H]
    z[COUNT] = n + 1


@compiled
def advance(z: Floats, step: float, reach: float, up: float, down: float, softening: float) -> float:
    """Move the memory `z` by `step` (m) and return h.

    `reach` (m) is from rest to sliding, `up` and `down` the exponents of the branches (1); branches that
    start at a force h_r reach further by the factor 1 + softening |h_r|.
    """
    if step == 0.0:
        return float(z[H])
    way = 1.0 if step > 0.0 else -1.0
    shape = up if way > 0.0 else down
    if z[WAY] == -way:
        _turn(z, reach, shape)
        z[FROM] = z[XI]
    z[WAY] = way
    z[XI] += step
    while True:
        n = int(z[COUNT])
        if n == 1 and z[SLID] == 0.0:  # beyond the first reversal ever: the virgin curve goes on
            z[COUNT] = n = 0
        if n == 0:
            if z[SLID] == 0.0 and abs(z[XI]) < reach:
                z[H] = way * virgin(abs(z[XI]) / reach, shape)
            else:
                z[SLID] = 1.0
                z[H] = way
            break
        start, force = z[AT + n - 1], z[AT + DEPTH + n - 1]
        span = 2.0 * reach * (1.0 + softening * abs(force))
        gone = way * (z[XI] - start)
        if n == 1:
            if gone >= span:
                z[COUNT] = 0.0
                continue
            z[H] = force + (way - force) * virgin(gone / span, shape)
            break
        whole = way * (z[AT + n - 2] - start)
        if gone >= whole:
            z[COUNT] = n - 2
            continue
        full = virgin(whole / span, shape)
        part = virgin(gone / span, shape) / full if full > 1e-12 else gone / whole
        z[H] = force + (z[AT + DEPTH + n - 2] - force) * part
        break
    return float(z[H])


@compiled
def along(position: Floats, reach: float, shape: float, out: Floats) -> None:
    """Write h along `position` (m, (K,)) into `out` (K,), from a fresh memory."""
    z = np.zeros(AT + 2 * DEPTH)
    for k in range(1, position.size):
        out[k] = advance(z, position[k] - position[k - 1], reach, shape, shape, 0.0)


@compiled
def stops_along(position: Floats, stiffness: Floats, reach: Floats) -> Floats:
    """Return the force (N, (K, n)) of each stop element along `position` (m, (K,)), all relaxed at first."""
    out = np.zeros((position.size, reach.size))
    z = np.zeros(reach.size)
    for k in range(1, position.size):
        step = position[k] - position[k - 1]
        for i in range(reach.size):
            z[i] = max(-reach[i], min(reach[i], z[i] + step))
            out[k, i] = stiffness[i] * z[i]
    return out


def stop_elements(level: float, reach: float, shape: float, count: int) -> list[tuple[float, float]]:
    """Return `count` stop elements (stiffness N/m, reach m) whose sum has the virgin curve's chords.

    Knots are spaced so that every chord misses the curve by about as much (1 / (2 count^2) of the level).
    """
    knots = 1.0 - (1.0 - np.arange(count + 1) / count) ** (2.0 / shape)
    slopes = np.append(np.diff(1.0 - (1.0 - knots) ** shape) / np.diff(knots), 0.0) * level / reach
    return [(float(slopes[i] - slopes[i + 1]), float(knots[i + 1] * reach)) for i in range(count)]
