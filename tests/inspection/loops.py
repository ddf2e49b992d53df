"""Motions with major and minor loops, and hystereses whose properties are known."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.inspection.branches import Branch, branches
from rtcomp.inspection.kinds import Kind, kinds_of

Floats = np.ndarray


def walk(points: Iterable[float], step: float = 1.0) -> Floats:
    """Positions on the way through `points`, equally spaced; all are multiples of `step`."""
    way = [0.0]
    for point in points:
        count = round(abs(point - way[-1]) / step)
        way += list(np.linspace(way[-1], point, count + 1)[1:])
    return np.round(np.array(way) / step) * step


def major_and_minor(cycles: int = 4, step: float = 1.0) -> Floats:
    """Major loops to +-60 with a minor loop on each of their branches, all turning points whole numbers."""
    return walk([60.0, -60.0, *(60.0, 12.0, 40.0, -60.0, -20.0, -44.0) * cycles, 60.0, -60.0], step)


def operator(
    weights: Iterable[float] = (9.0, 5.0, 3.0, 1.0), widths: Iterable[float] = (4, 12, 24, 60)
) -> HysteresisModel:
    """An interval operator, symmetric and congruent, with corners at whole numbers."""
    return HysteresisModel(IntervalBasis(np.array(list(widths), dtype=float)), np.array(list(weights)))


def cut(position: Floats, force: Floats, least: float = 5.0) -> list[Branch]:
    """The branches of a motion of one row a second."""
    return branches(np.arange(position.size) * 1.0, position, force, least)


def sorted_kinds(position: Floats, force: Floats, least: float = 5.0, near: float = 1.0) -> list[Kind]:
    """Its kinds of branches."""
    return kinds_of(cut(position, force, least), near, float(np.ptp(force)))
