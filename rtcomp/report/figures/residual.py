"""Where simulation and recording differ: the residual force against any axis, before and after."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from rtcomp.report import palette
from rtcomp.report.decimate import Floats, peak_indices
from rtcomp.report.figures import canvas as c
from rtcomp.report.quantities import Scale, scale

BEFORE, AFTER, NAMED = "as believed, refitted", "extended stage", "what was named"
FORCE, SIGNED = "Residual force", "Residual force, with the sign of the motion"
_FEW = 6
"""Points up to which each is drawn with its own error bar."""
_MANY = 60
"""Stretches of rows that are shaded one by one; beyond, short breaks between them are closed."""


def place_figure(
    axis: str,
    unit: str,
    x: npt.ArrayLike,
    before: npt.ArrayLike,
    *,
    after: npt.ArrayLike | None = None,
    spread: npt.ArrayLike | None = None,
    region: tuple[float, float] | None = None,
    force_unit: str = "N",
    signed: bool = False,
) -> go.Figure:
    """Return the mean residual force along an axis (bins at `x`, in `unit`), before and after.

    `before` and `after` in `force_unit`, `spread` their standard error before; two of it are drawn to either
    side. `region` shades where the mismatch shows. Where `signed`, forces are given the sign of the motion,
    and the axis says so. Raises ValueError where lengths differ.
    """
    at, first = c.floats(x), c.floats(before)
    second = None if after is None else c.floats(after)
    error = None if spread is None else c.floats(spread)
    c.same_length(x=at, before=first, after=second, spread=error)
    along, up, figure = _axes(axis, unit, at, force_unit, [first, second], SIGNED if signed else FORCE)
    if c.say_if_empty(figure, [first, second]):
        return figure
    _zero(figure)
    if region is not None and at.size > _FEW and region[1] - region[0] < 0.9 * np.ptp(at):
        c.note(figure, "Shaded: where it shows.")
        _shade(figure, region[0] * along.factor, region[1] * along.factor)
    few = at.size <= _FEW
    if error is not None and not few:
        drawn = np.isfinite(first) & np.isfinite(error)
        outline = np.concatenate([at[drawn], at[drawn][::-1]]) * along.factor
        band = np.concatenate([(first + 2 * error)[drawn], (first - 2 * error)[drawn][::-1]]) * up.factor
        figure.add_scatter(
            x=c.compact(outline), y=c.compact(band), mode="lines", line={"width": 0}, fill="toself",
            fillcolor=palette.WITHOUT, opacity=0.16, name="two standard errors", hoverinfo="skip",
        )  # fmt: skip
    for name, values, colour, dash in (
        (BEFORE, first, palette.WITHOUT, "solid"),
        (AFTER, second, palette.WITH, "solid"),
    ):
        if values is None:
            continue
        if few:
            bars = {"type": "data", "array": 2 * error * up.factor} if error is not None else None
            figure.add_scatter(
                x=at * along.factor, y=values * up.factor, name=name, mode="markers",
                marker={"color": colour, "size": 11, "symbol": "circle" if values is first else "diamond"},
                error_y=bars if values is first else None,
            )  # fmt: skip
        else:
            c.line(figure, at * along.factor, values * up.factor, name, colour, width=2, dash=dash)
    if axis == "direction":
        figure.update_xaxes(
            tickvals=[-1, 1], ticktext=["down", "up"], range=[-1.8, 1.8], title={"text": "Direction"}
        )
    elif _spans_decades(at):
        good = at[at > 0.0] * along.factor
        figure.update_xaxes(c.logarithmic(float(good.min()), float(good.max()), room=0.02))
    return figure


def named_figure(
    axis: str,
    unit: str,
    x: npt.ArrayLike,
    data: npt.ArrayLike,
    curve: npt.ArrayLike,
    *,
    name: str = NAMED,
    force_unit: str = "N",
    signed: bool = False,
) -> go.Figure:
    """Return the residual force without the named effect (`data`, in bins at `x`) and its curve over it.

    Where `signed`, both are given the sign of the motion, and the axis says so. Raises ValueError where
    lengths differ.
    """
    at, points, line = c.floats(x), c.floats(data), c.floats(curve)
    c.same_length(x=at, data=points, curve=line)
    along, up, figure = _axes(axis, unit, at, force_unit, [points, line], SIGNED if signed else FORCE)
    if c.say_if_empty(figure, [points, line]):
        return figure
    _zero(figure)
    kept = peak_indices([points, line], c.POINTS)
    figure.add_scatter(
        x=c.compact(at[kept] * along.factor), y=c.compact(points[kept] * up.factor), mode="markers",
        marker={"color": palette.MEASURED, "size": 7 if at.size < 120 else 4},
        name="recorded, mean of each bin",
    )  # fmt: skip
    c.line(figure, at[kept] * along.factor, line[kept] * up.factor, c.safe(name), palette.MODEL, width=2.6)
    if _spans_decades(at):
        good = at[at > 0.0] * along.factor
        figure.update_xaxes(c.logarithmic(float(good.min()), float(good.max()), room=0.02))
    return figure


def residual_figure(
    time: npt.ArrayLike,
    before: npt.ArrayLike,
    after: npt.ArrayLike,
    *,
    unseen: npt.ArrayLike | None = None,
    force_unit: str = "N",
    points: int = c.POINTS,
) -> go.Figure:
    """Return the residual force against time (s), before and after; rows where `unseen` is not 0 are shaded.

    Recordings one behind the other are drawn so, each beginning where the last ended. Raises ValueError where
    lengths differ.
    """
    t, first, second = c.floats(time), c.floats(before), c.floats(after)
    shaded = None if unseen is None else c.floats(unseen)
    c.same_length(time=t, before=first, after=second, unseen=shaded)
    starts = np.flatnonzero(np.diff(t) <= 0.0) + 1
    for start in starts.tolist():
        t = np.concatenate([t[:start], t[start:] - t[start] + 2 * t[start - 1] - t[start - 2]])
    in_time, up, figure = _axes("time", "s", t, force_unit, [first, second])
    if c.say_if_empty(figure, [first, second]):
        return figure
    _zero(figure)
    if shaded is not None:
        for begin, end in _stretches(shaded != 0.0):
            _shade(figure, t[begin] * in_time.factor, t[end - 1] * in_time.factor)
    kept = peak_indices([first, second], points)
    c.line(figure, t[kept] * in_time.factor, first[kept] * up.factor, BEFORE, palette.WITHOUT, width=1.2)
    if not np.array_equal(first, second, equal_nan=True):
        c.line(figure, t[kept] * in_time.factor, second[kept] * up.factor, AFTER, palette.WITH, width=1.2)
    figure.update_layout(hovermode="closest")
    c.note_thinned(figure, len(kept), len(t))
    if starts.size:
        c.note(figure, f"{starts.size + 1} recordings, one behind the other.")
    return figure


def _axes(
    axis: str, unit: str, x: Floats, force_unit: str, ys: list[Floats | None], what: str = FORCE
) -> tuple[Scale, Scale, go.Figure]:
    along = scale(unit, x)
    up = scale(force_unit, *(y for y in ys if y is not None))
    title = c.titled(axis[:1].upper() + axis[1:], along.unit)
    return along, up, c.canvas(title, c.titled(what, up.unit))


def _zero(figure: go.Figure) -> None:
    figure.add_shape(
        type="line", xref="paper", x0=0, x1=1, y0=0, y1=0, layer="below",
        line={"color": palette.AXIS, "width": 1},
    )  # fmt: skip


def _shade(figure: go.Figure, begin: float, end: float) -> None:
    figure.add_shape(
        type="rect", yref="paper", y0=0, y1=1, x0=begin, x1=end, layer="below",
        line={"width": 0}, fillcolor=palette.AXIS, opacity=0.22,
    )  # fmt: skip


def _stretches(marked: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return begin and end of each stretch of rows that are marked, so many at most that a figure bears."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marked.astype(np.int8), [0]])))
    begins, ends = edges[::2], edges[1::2]
    while begins.size > _MANY:
        wide = np.flatnonzero(begins[1:] - ends[:-1] > np.median(begins[1:] - ends[:-1]))
        begins, ends = (
            np.concatenate([begins[:1], begins[wide + 1]]),
            np.concatenate([ends[wide], ends[-1:]]),
        )
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def _spans_decades(x: Floats) -> bool:
    """Return whether `x` is spread over so many decades that only a log axis shows it."""
    good = x[np.isfinite(x)]
    return bool(good.size > _FEW and good.min() > 0.0 and good.max() > 30.0 * good.min()) and bool(
        np.std(np.diff(np.log(good))) < np.std(np.diff(good) / np.mean(np.diff(good)))
    )
