"""The curve of a named effect over what was recorded, along the axis that it follows most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.mismatch.locate import Axis
from rtcomp.diagnosis.result import Place
from rtcomp.kernels import Floats

BINS = 120
"""Points of a curve."""
WAVES = 8
"""Periods of a wave that are drawn, of more in the stroke."""


class Curve(NamedTuple):
    """To draw: axis, its unit, bin centres (B,), residual force without the effect (N), its force (N)."""

    axis: str
    unit: str
    x: Floats
    data: Floats
    curve: Floats
    signed: bool = False
    """Whether both forces are given the sign of the motion, as friction has it."""


def curve_of(looked: Sequence[Axis], entry: Entry, force: Floats, without: Floats) -> Curve:
    """Return the curve of an `entry`: its `force` and what is left `without` it (N, (n,)) on an axis.

    That of a tone goes along one of its periods.
    """
    waves = [a for a in looked if a.name == "position"] if ent.PERIOD in entry else looked
    if (frequency := ent.tone_of(entry)) > 0.0:
        time = next(a for a in looked if a.name == "time")
        waves = [replace(time, name="time within a period", values=time.values % (1.0 / frequency))]
    return _along(waves, force, without, entry.get(ent.PERIOD))


def left_over(places: Sequence[Place]) -> Curve | None:
    """Return the curve of what no entry explains: its means along the place where most of it shows, smoothed.

    `places` are those of the residual that is left, the strongest first; None where it has none.
    """
    place = next((p for p in places if p.axis != "frequency" and p.x.size > 2), None)
    if place is None:
        return None
    wide = np.concatenate([place.before[:1], place.before, place.before[-1:]])
    smooth = np.convolve(wide, [0.25, 0.5, 0.25], mode="valid")
    return Curve(place.axis, place.unit, place.x, place.before, smooth)


def _along(looked: Sequence[Axis], force: Floats, without: Floats, period: object) -> Curve:
    """Draw along the axis in whose bins most of the force is, a wave along the stroke."""
    if isinstance(period, int | float):
        tables = [_binned(a, _wave_edges(a.values, float(period)), force, without) for a in looked]
    else:
        tables = [_binned(a, _edges(a), force, without) for a in looked]
    best = max(range(len(looked)), key=lambda i: _explained(tables[i], force))
    return _curve(looked[best], tables[best])


class _Table(NamedTuple):
    centres: Floats
    rows: Floats
    data: Floats
    curve: Floats


def _edges(axis: Axis) -> Floats:
    if axis.name == "direction":
        return np.array([-1.5, -0.5, 0.5, 1.5])
    # What has the sign of the motion is told from what the motion does by means over many strokes.
    count = BINS // 8 if axis.name == "time" and axis.odd is not None else BINS // 2
    edges = np.unique(np.quantile(axis.values, np.linspace(0.0, 1.0, count + 1)))
    return edges if edges.size > 1 else np.array([edges[0] - 0.5, edges[0] + 0.5])


def _wave_edges(x: Floats, period: float) -> Floats:
    low, high = float(x.min()), float(x.max())
    begin = max(low, min(float(np.median(x)) - WAVES / 2 * period, high - WAVES * period))
    return np.linspace(begin, min(high, begin + WAVES * period), BINS + 1)


def _binned(axis: Axis, edges: Floats, force: Floats, without: Floats) -> _Table:
    inside = (axis.values >= edges[0]) & (axis.values <= edges[-1])
    sign = np.ones(force.size) if axis.odd is None else axis.odd
    at = np.clip(np.searchsorted(edges, axis.values[inside], side="right") - 1, 0, edges.size - 2)
    count = np.bincount(at, minlength=edges.size - 1).astype(np.float64)

    def mean(rows: Floats) -> Floats:
        total = np.bincount(at, weights=(rows * sign)[inside], minlength=edges.size - 1)
        return np.asarray(total / np.maximum(count, 1.0))

    return _Table(0.5 * (edges[1:] + edges[:-1]), count, mean(without), mean(force))


def _explained(table: _Table, force: Floats) -> float:
    return float(np.sum(table.rows * table.curve**2) / table.rows.sum()) / float(np.mean(force**2))


def _curve(axis: Axis, table: _Table) -> Curve:
    kept = table.rows > 0
    signed = axis.odd is not None
    return Curve(axis.name, axis.unit, table.centres[kept], table.data[kept], table.curve[kept], signed)
