"""How fast it is learned, and curves of anything over each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from rtcomp.report import palette
from rtcomp.report.decimate import Floats, peak_indices
from rtcomp.report.figures import canvas as c
from rtcomp.report.quantities import scale, si


class Curve(NamedTuple):
    """One named curve; a `role` (reference, measured, model, without, with) fixes its colour."""

    name: str
    x: npt.ArrayLike
    y: npt.ArrayLike
    role: str = ""


def _look(curve: Curve, index: int) -> tuple[str, str]:
    return (palette.ROLES[curve.role], "solid") if curve.role else palette.series(index)


def learning_figure(
    curves: Sequence[Curve],
    *,
    x_unit: str = "cycles",
    levels: Mapping[str, float] | None = None,
    log_x: bool = False,
) -> go.Figure:
    """Return held-out error (y, in % of the peak force) of one or several learners, on a log axis.

    x counts `x_unit` (``"cycles"`` or ``"s"``). `levels` are horizontal lines to compare with, name to %.
    Errors that are zero or not finite have no place on a log axis and leave a gap.
    """
    what = "Learning time" if x_unit == "s" else "Learned from"
    figure = c.canvas(c.titled(what, x_unit), c.titled("Held-out error", "%"))
    ys = [np.where(c.floats(k.y) > 0.0, c.floats(k.y), np.nan) for k in curves]
    if c.say_if_empty(figure, ys):
        return figure
    for index, (curve, y) in enumerate(zip(curves, ys, strict=True)):
        x = c.floats(curve.x)
        c.same_length(x=x, y=y)
        if not np.isfinite(y).any():
            continue
        kept = peak_indices([y], c.POINTS)
        colour, dash = _look(curve, index)
        if len(curves) == 1 and not curve.role:
            colour = palette.MODEL
        last = y[np.isfinite(y)][-1]
        few = len(kept) <= 60
        figure.add_scatter(
            x=c.compact(x[kept]), y=c.compact(y[kept]), name=f"{c.safe(curve.name)}: {si(last, '%')}",
            mode="lines+markers" if few else "lines",
            line={"color": colour, "width": 2, "dash": dash}, marker={"color": colour, "size": 5},
        )  # fmt: skip
    for name, level in (levels or {}).items():
        figure.add_shape(
            type="line", xref="paper", x0=0, x1=1, y0=level, y1=level,
            line={"color": palette.MUTED, "width": 1, "dash": "dash"},
        )  # fmt: skip
        text = f"{c.safe(name)}: {si(level, '%')}"
        figure.add_annotation(
            text=text, xref="paper", x=1, xanchor="right", y=float(np.log10(level)), yanchor="bottom",
            showarrow=False, font={"color": palette.MUTED, "size": 12},
        )  # fmt: skip
    _logarithmic_y(figure, [*ys, c.floats(list((levels or {}).values()))])
    if log_x:
        _logarithmic_x(figure, [c.floats(k.x) for k in curves])
    else:
        figure.update_xaxes(rangemode="tozero")
    figure.update_layout(showlegend=True)
    return figure


def overlay_figure(
    curves: Sequence[Curve],
    *,
    x_title: str,
    y_title: str,
    x_unit: str = "1",
    y_unit: str = "1",
    log_x: bool = False,
    log_y: bool = False,
    points: int = c.POINTS,
) -> go.Figure:
    """Return several curves over each other, x in `x_unit`, y in `y_unit`, each with its own rows.

    Raises ValueError where a curve's x and y differ in length.
    """
    xs, ys = [c.floats(k.x) for k in curves], [c.floats(k.y) for k in curves]
    along, up = scale(x_unit, *xs), scale(y_unit, *ys)
    figure = c.canvas(c.titled(x_title, along.unit), c.titled(y_title, up.unit))
    if c.say_if_empty(figure, ys):
        return figure
    for index, (curve, x, y) in enumerate(zip(curves, xs, ys, strict=True)):
        c.same_length(x=x, y=y)
        kept = peak_indices([y], points)
        colour, dash = _look(curve, index)
        c.line(
            figure,
            x[kept] * along.factor,
            y[kept] * up.factor,
            c.safe(curve.name),
            colour,
            width=2,
            dash=dash,
        )
        c.note_thinned(figure, len(kept), len(y))
    if log_x:
        _logarithmic_x(figure, [x * along.factor for x in xs])
    if log_y:
        _logarithmic_y(figure, [y * up.factor for y in ys])
    return figure


def _positive(arrays: Sequence[Floats]) -> Floats:
    values = np.concatenate([*arrays, np.empty(0)])
    good: Floats = values[np.isfinite(values) & (values > 0.0)]
    return good


def _logarithmic_x(figure: go.Figure, arrays: Sequence[Floats]) -> None:
    good = _positive(arrays)
    if good.size:
        figure.update_xaxes(c.logarithmic(float(good.min()), float(good.max()), room=0.0))


def _logarithmic_y(figure: go.Figure, arrays: Sequence[Floats]) -> None:
    good = _positive(arrays)
    if good.size:
        figure.update_yaxes(c.logarithmic(float(good.min()), float(good.max())))
