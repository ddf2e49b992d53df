"""Yield displacements of the friction units: a coarse grid, the believed ones, and both joined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis.recordings.data import Data
from rtcomp.kernels import Floats
from rtcomp.physics.maxwell_slip import MaxwellSlip
from rtcomp.stage.stage import Stage

GRID = 22
"""Yield displacements of the coarse friction grid, from the sensor's grain on."""
LONGEST, YIELDS = 0.125, 0.5
"""Parts of the stroke: the longest yield displacement looked for, and that beyond which nothing yields."""
BEYOND = 1.3
"""Times the longest believed one that friction may reach."""
MOST_OWN = 10
"""Believed yield displacements up to which they are taken into the grid as they are."""


def elements_of(stage: Stage) -> tuple[list[tuple[float, ...]], float]:
    """Return the believed friction elements (N/m, m), and the exponent of the law by which they yield."""
    friction = stage.friction
    return (list(friction.elements), friction.exponent) if isinstance(friction, MaxwellSlip) else ([], 0.0)


def grid(stage: Stage, data: Data, grain: float) -> Floats:
    """Return yield displacements (m) from the grain to an eighth of the stroke, the believed ones in it.

    A motion that hardly leaves the presliding that is believed has longer ones, up to what it could yield.
    """
    low, high = data.stroke
    longest = LONGEST * (high - low)
    shortest = max(2.0 * grain, 1e-5 * longest)
    own = [r for _, r in elements_of(stage)[0]]
    if own:
        shortest = min(shortest, *own)
        longest = max(longest, min(BEYOND * max(own), YIELDS * (high - low)))
    return np.geomspace(min(shortest, 0.5 * longest), longest, GRID)


def further(reaches: Floats, stroke: float) -> Floats:
    """Return a grid (m) that goes on in the same steps, up to where nothing yields on such a stroke (m)."""
    step = np.log(reaches[1] / reaches[0])
    more = np.arange(np.log(reaches[-1]) + step, np.log(YIELDS * stroke), step)
    return np.append(reaches, np.exp(more))


def joined(own: Floats, grid: Floats, step: float) -> Floats:
    """Return believed yield displacements (m) and those of a grid that are not close to one of them."""
    if not own.size:
        return np.sort(grid)
    apart = np.min(np.abs(np.log(grid[:, None] / own[None, :])), axis=1)
    return np.sort(np.concatenate([own, grid[apart > 0.3 * step]]))


def on_grid(elements: Sequence[Sequence[float]], reaches: Floats) -> Floats:
    """Return the stiffnesses (N/m) at some `reaches` (m, (N,)) that hold as much as elements (N/m, m) do."""
    found = np.zeros(reaches.size)
    if elements:
        k, r = np.array(elements).T
        at = np.argmin(np.abs(np.log(reaches[:, None] / r)), axis=0)
        np.add.at(found, at, k * r / reaches[at])
    return found
