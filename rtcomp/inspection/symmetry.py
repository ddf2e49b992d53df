"""The symmetry test: the major loop's mirrored branch over the branch (the paper's Fig. 11a)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.inspection.branches import on_grid
from rtcomp.inspection.chance import Compared, Verdict, compare, distances
from rtcomp.inspection.kinds import MajorLoop
from rtcomp.kernels import Floats

POINTS = 200
MOST = 40
"""Repeats of each branch that are compared at most."""


@dataclass(frozen=True)
class Symmetry:
    """What the mirrored major loop says. Curves run over `travel` (m, (G,)) from the turning point.

    rising, falling: (G,), N, the mean branch about its own mean, the falling one mirrored at the loop's
    centre (point reflection): half way between its turning points, at the force where the difference is
    smallest, so that its mean is zero. A loop is symmetric where there is such a centre; a constant force
    only moves it.
    """

    travel: Floats
    rising: Floats
    falling: Floats
    half_range: float
    """N, half of the force range of the loop: what the figures are parts of."""
    level: float
    """N, half of the loop's mean opening: what the mean branches stand above and below the centre."""
    compared: Compared
    repeats: tuple[int, int]

    @property
    def difference(self) -> Floats:
        """Rising less mirrored falling mean branch (N, (G,))."""
        return self.rising - self.falling

    @property
    def peak(self) -> float:
        """Largest difference of the mean branches, N."""
        return float(np.max(np.abs(self.difference)))

    @property
    def peak_at(self) -> float:
        """Where it is, as part of the way from the turning point (0 to 1)."""
        return float(self.travel[int(np.argmax(np.abs(self.difference)))] / self.travel[-1])

    @property
    def mean_curve_share(self) -> float:
        """Part (squared, 0 to 1) of the difference that lies in the loop's mean curve.

        With M half of the sum and H half of the difference of both branches over the distance u from the
        centre, the difference is M(u) + M(-u) less its mean, an even part, from a force that goes with the
        position, whatever the direction, and H(u) - H(-u), an odd one, from a loop that is wider on one side.
        The parts are orthogonal.
        """
        d = self.difference
        even = 0.5 * (d + d[::-1])
        power = float(np.mean(d**2))
        return float(np.mean(even**2)) / power if power > 0.0 else 0.0

    @property
    def verdict(self) -> Verdict:
        """Say whether the loop is symmetric."""
        return self.compared.verdict(self.half_range)


def symmetry(loop: MajorLoop, seed: int = 0) -> Symmetry:
    """Compare the rising branches of a loop with its mirrored falling ones."""
    up, down = loop.rising.some(MOST), loop.falling.some(MOST)
    travel = np.linspace(0.0, loop.length, POINTS)
    curves = on_grid([*up, *down], travel)
    # Each about its own mean: where the centre of force lies is not what is asked.
    means = curves.mean(axis=1)
    curves = curves - means[:, None]
    height = means + np.array([b.sign * b.force for b in (*up, *down)])
    level = 0.5 * float(height[: len(up)].mean() + height[len(up) :].mean())
    until = np.full(len(curves), POINTS, dtype=np.intp)
    kinds = np.repeat(np.array([0, 1], dtype=np.intp), [len(up), len(down)])
    low, high = loop.forces
    return Symmetry(
        travel, curves[: len(up)].mean(axis=0), curves[len(up) :].mean(axis=0), 0.5 * (high - low), level,
        compare(distances(curves, until), kinds, np.zeros_like(kinds), seed),
        (len(loop.rising.repeats), len(loop.falling.repeats)),
    )  # fmt: skip
