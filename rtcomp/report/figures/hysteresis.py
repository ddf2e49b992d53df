"""The loop, measured and modelled, and the weights as the virgin curve."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from rtcomp.report import palette
from rtcomp.report.decimate import Floats, Indices, path_indices
from rtcomp.report.figures import canvas as c
from rtcomp.report.quantities import scale, si, typeset, written

_STEMS = 120
"""Interval boundaries drawn at most; more would be a grey area."""


def loop_figure(
    position: npt.ArrayLike,
    measured: npt.ArrayLike | None,
    model: npt.ArrayLike | None = None,
    *,
    virgin_rows: int = 0,
    held_out_percent: float | None = None,
    unit: str = "m",
    force_unit: str = "N",
    points: int = 2 * c.POINTS,
) -> go.Figure:
    """Return force against position, measured and modelled, as lines.

    Arrays of one length, position in `unit`, forces in `force_unit`. The first `virgin_rows` rows are the
    first loading from the virgin state and drawn dashed. `held_out_percent` is the error on this motion, in %
    of the peak force, where it was not learned from. Paths too long to draw faithfully show their last
    stretch, and say so. Raises ValueError where lengths differ or both forces are missing.
    """
    x = c.floats(position)
    force = {"measured": measured, "model": model}
    given = {name: c.floats(y) for name, y in force.items() if y is not None}
    if not given:
        raise ValueError("a loop needs the measured force, the modelled force or both")
    c.same_length(position=x, **given)
    along, up = scale(unit, x), scale(force_unit, *given.values())
    figure = c.canvas(c.titled("Position", along.unit), c.titled("Force", up.unit), height=460, unified=False)
    if c.say_if_empty(figure, list(given.values())) or c.say_if_empty(figure, [x]):
        return figure
    virgin = min(max(int(virgin_rows), 0), len(x))
    columns = [x, *given.values()]
    parts: list[tuple[Indices, bool]] = []
    if virgin > 1:
        parts.append((path_indices([a[:virgin] for a in columns], points // 4), True))
    rest = max(virgin - 1, 0)
    kept = path_indices([a[rest:] for a in columns], points) + rest
    parts.append((kept, False))
    look = {"measured": (palette.MEASURED, 4.5, 0.55), "model": (palette.MODEL, 1.6, 1.0)}
    where = f"%{{x:.4g}} {typeset(along.unit)}, %{{y:.4g}} {typeset(up.unit)}"
    for rank, (name, y) in enumerate(given.items()):
        colour, width, opacity = look[name]
        for rows, first in parts:
            called, thick, dash = (f"{name}, virgin", 0.6 * width, "dot") if first else (name, width, "solid")
            c.line(
                figure, x[rows] * along.factor, y[rows] * up.factor, called, colour, width=thick, dash=dash,
                opacity=opacity, legendrank=10 * int(first) + rank, hovertemplate=where,
            )  # fmt: skip
    figure.update_xaxes(range=c.padded(x * along.factor))
    if held_out_percent is not None:
        c.note(figure, f"Held-out error {si(held_out_percent, '%')} of the peak force, weights frozen.")
    if kept.size and kept[0] > rest:
        c.note(figure, f"Drawn: the last {len(x) - int(kept[0])} of {len(x)} samples; more is unreadable.")
    elif sum(len(rows) for rows, _ in parts) < len(x):
        c.note(figure, "Drawn with fewer points than samples, all reversals and peaks kept.")
    return figure


def first_reversal(position: npt.ArrayLike, back: float = 0.02) -> int:
    """Return how many rows go by until motion first turns back: `virgin_rows` of a run from rest.

    A reversal is one of at least `back` of the motion's range, so that noise is none. Returns 0 where the
    motion never turns back or where a position is not finite.
    """
    x = c.floats(position)
    if x.size == 0 or not np.isfinite(x).all():
        return 0
    least = back * float(np.ptp(x))
    moved = np.flatnonzero(np.abs(x - x[0]) > least)
    if moved.size == 0:
        return 0
    way = float(np.sign(x[moved[0]] - x[0])) * x
    turned = np.flatnonzero(np.maximum.accumulate(way) - way > least)
    turned = turned[turned > moved[0]]
    return int(np.argmax(way[: turned[0]])) + 1 if turned.size else 0


def virgin_curve(widths: npt.ArrayLike, weights: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Return (travel, force) at the interval boundaries, from the virgin state, first point (0, 0).

    From (5), half of each interval is still to be activated, so interval i is passed over a_i / 2 of travel
    and adds w_i a_i / 2 of force. `widths` in m, `weights` in N/m, one length N; the results have N + 1.
    """
    a, w = c.floats(widths), c.floats(weights)
    c.same_length(widths=a, weights=w)
    travel = np.concatenate(([0.0], np.cumsum(a / 2.0)))
    # One weight that is not a number must not blank the whole curve.
    force = np.concatenate(([0.0], np.cumsum(np.where(np.isfinite(w), w, 0.0) * a / 2.0)))
    return travel, force


def virgin_figure(
    widths: npt.ArrayLike,
    weights: npt.ArrayLike,
    *,
    reached: npt.ArrayLike | None = None,
    truth: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    unit: str = "m",
    force_unit: str = "N",
) -> go.Figure:
    """Return the weights as the virgin curve they stand for, with the interval boundaries.

    `widths` (`unit`) and `weights` (`force_unit` per `unit`) have one entry an interval. `reached` is the
    part of each (0 to 1, or whether at all) that the motion learned from exercised; where it is 0, it
    is drawn hollow and grey. `truth` is the true virgin curve, (travel, force), where it is known. Raises
    ValueError where lengths differ.
    """
    a, w = c.floats(widths), c.floats(weights)
    touched = np.ones(len(a), dtype=bool) if reached is None else c.floats(reached) > 0.0
    c.same_length(widths=a, weights=w, reached=touched.astype(np.float64))
    travel, force = virgin_curve(a, w)
    true = None if truth is None else (c.floats(truth[0]), c.floats(truth[1]))
    if true is not None:
        c.same_length(truth_travel=true[0], truth_force=true[1])
    along = scale(unit, travel)
    up = scale(force_unit, force, *([] if true is None else [true[1]]))
    figure = c.canvas(
        c.titled("Travel from the virgin state", along.unit),
        c.titled("Force", up.unit),
        height=420,
        unified=False,
    )
    if c.say_if_empty(figure, [w], "no intervals"):
        return figure
    x, y = travel * along.factor, force * up.factor
    every = max(1, -(-len(a) // _STEMS))
    gap = np.full(len(x[1::every]), np.nan)
    stems_x = np.column_stack((x[1::every], x[1::every], gap)).reshape(-1)
    stems_y = np.column_stack((np.zeros_like(gap), y[1::every], gap)).reshape(-1)
    c.line(figure, stems_x, stems_y, "interval boundaries", palette.AXIS, width=0.8, hoverinfo="skip")
    if true is not None:
        inside = true[0] <= travel[-1] * 1.05
        c.line(
            figure, true[0][inside] * along.factor, true[1][inside] * up.factor, "true virgin curve",
            palette.REFERENCE, width=4.0, hoverinfo="skip",
        )  # fmt: skip

    def says(i: int) -> str:
        width, weight = written(a[i], unit, printed=True), written(w[i], f"{force_unit}/{unit}", printed=True)
        return f"interval {i + 1}: width {width}, weight {weight}"

    for flag, name, colour, dash in (
        (True, "model", palette.MODEL, "solid"),
        (False, "never reached", palette.MUTED, "dot"),
    ):
        mine = np.flatnonzero(touched == flag)
        if mine.size == 0:
            continue
        # Each interval is its own stroke, so that reached and unreached ones may alternate.
        lines_x = np.column_stack((x[mine], x[mine + 1], np.full(mine.size, np.nan))).reshape(-1)
        lines_y = np.column_stack((y[mine], y[mine + 1], np.full(mine.size, np.nan))).reshape(-1)
        c.line(
            figure, lines_x, lines_y, name, colour, width=2.0, dash=dash,
            showlegend=False, legendgroup=name, hoverinfo="skip",
        )  # fmt: skip
        dots = mine[::every]
        figure.add_scatter(
            x=c.compact(x[dots + 1]), y=c.compact(y[dots + 1]), name=name, mode="markers", legendgroup=name,
            marker={
                "color": colour if flag else palette.PAPER, "size": 7 if len(a) <= 60 else 4,
                "line": {"color": colour, "width": 1.5},
            },
            text=[says(int(i)) for i in dots], hovertemplate="%{text}<extra></extra>",
        )  # fmt: skip
    unreached = int(np.sum(~touched))
    if unreached:
        c.note(
            figure, f"{unreached} of {len(a)} intervals were never reached; their weights are not learned."
        )
    if every > 1:
        c.note(figure, f"One interval boundary in {every} is drawn.")
    return figure
