"""What Fig. 11 looks at: whether a loop is its own mirror image, and whether branches are alike."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from rtcomp.inspection.branches import turning_points
from rtcomp.kernels import Floats


def since_reversal(position: Floats) -> Floats:
    """Return the way (m) made since the last reversal at each row, (K,)."""
    way = np.zeros(position.size)
    moves = np.diff(position)
    direction = 0.0
    for k, move in enumerate(moves, 1):
        turned = move * direction < 0.0
        direction = np.sign(move) if move else direction
        way[k] = abs(move) + (0.0 if turned else way[k - 1])
    return way


def mirrored(position: Floats, force: Floats) -> tuple[Floats, Floats, float]:
    """Return a closed loop turned half round about its middle, and how far the two lie apart at most.

    position, force: one cycle, (K,). The distance (1) is over half the height, along branches of equal
    direction.
    """
    middle = 0.5 * (position.max() + position.min()), 0.5 * (force.max() + force.min())
    x, y = 2 * middle[0] - position, 2 * middle[1] - force
    grid = np.linspace(position.min(), position.max(), 401)[20:-20]

    def rising(u: Floats, f: Floats) -> Floats:
        low, high = int(np.argmin(u)), int(np.argmax(u))
        order = np.arange(low, high + (0 if high > low else u.size)) % u.size
        along = np.maximum.accumulate(u[order])
        return np.interp(grid, along, f[order])

    apart = np.abs(rising(position, force) - rising(x, y)).max()
    return x, y, float(apart / (0.5 * np.ptp(force)))


def branches(position: Floats, force: Floats, least: float) -> list[tuple[Floats, Floats]]:
    """Return every branch between two reversals of `least` (m) with its turning point in the origin.

    Falling branches are turned over, so that all rise: way (m) and force (N) since the reversal.
    """
    found = []
    turns = turning_points(position, least)
    for a, b in itertools.pairwise(turns):
        sign = np.sign(position[b] - position[a])
        found.append((sign * (position[a : b + 1] - position[a]), sign * (force[a : b + 1] - force[a])))
    return found


def to_and_back(position: Floats, force: Floats) -> list[tuple[Floats, Floats]]:
    """Return both branches of a cycle from low to low as `branches` does: noise makes no reversal."""
    top = int(np.argmax(position))
    return [
        (position[: top + 1] - position[0], force[: top + 1] - force[0]),
        (position[top] - position[top:], force[top] - force[top:]),
    ]


def apart(found: Sequence[tuple[Floats, Floats]]) -> float:
    """Return how far branches lie apart at most, over the height of the highest (1), where two reach."""
    height = max(float(y.max()) for _, y in found)
    grid = np.linspace(0.0, max(float(x.max()) for x, _ in found), 200)
    rows = [np.where(grid <= x.max(), np.interp(grid, np.maximum.accumulate(x), y), np.nan) for x, y in found]
    stack = np.array(rows)
    several = np.sum(np.isfinite(stack), axis=0) >= 2
    widest = np.nanmax(stack[:, several], axis=0) - np.nanmin(stack[:, several], axis=0)
    return float(widest.max() / height)
