"""Was it in time: lateness and execution time of the ticks."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from rtcomp.report import palette
from rtcomp.report.figures import canvas as c
from rtcomp.report.quantities import scale, written

_BINS = 90
_QUANTILES = {"p50": 50.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}


def _histogram(values: npt.ArrayLike, title: str, limit_us: float | None, limit_name: str) -> go.Figure:
    us = c.floats(values)
    us = us[np.isfinite(us)]
    if us.size == 0:
        figure = c.canvas(c.titled(title, "us"), "Ticks")
        c.say_if_empty(figure, [us], "no ticks")
        return figure
    low, high = float(us.min()), float(us.max())
    if limit_us is not None:
        high = max(high, limit_us)
    foot, *quantiles = (float(q) for q in np.percentile(us, [0.1, *_QUANTILES.values()]))
    middle = quantiles[0]
    # A far tail squeezes everything else into one linear bin; then the axis is logarithmic.
    log_x = low >= 0.0 and middle > 0.0 and high > 30.0 * middle
    shown = scale("us", np.sqrt(middle * high)) if log_x else scale("us", us, high)
    figure = c.canvas(c.titled(title, shown.unit), "Ticks", unified=False)
    figure.update_layout(showlegend=False, margin={"t": 80})
    floor = low
    if log_x:
        floor = max(low, min(middle, foot) / 3.0, high * 1e-7)
        edges = np.geomspace(floor, high * 1.02, _BINS + 1)
        us_binned = np.maximum(us, floor)
    else:
        spread = max(high - low, 1e-3 * max(abs(high), 1.0))
        edges = np.linspace(
            min(low, 0.0) if low < 0.5 * high else low - 0.02 * spread, high + 0.02 * spread, _BINS + 1
        )
        us_binned = us
    counts, edges = np.histogram(us_binned, edges)
    edges = edges * shown.factor
    x = np.repeat(edges, 2)
    # A step outline instead of bars: on a log axis bars of unequal width leave seams.
    y = np.concatenate(([0.5], np.repeat(np.where(counts > 0, counts, 0.5).astype(np.float64), 2), [0.5]))
    figure.add_scatter(
        x=c.compact(x), y=c.compact(y), mode="lines", line={"color": palette.MEASURED, "width": 1.4},
        fill="tozeroy", name="ticks", hoverinfo="skip",
    )  # fmt: skip
    marks = [(name, value, palette.INK) for name, value in zip(_QUANTILES, quantiles, strict=True)]
    if limit_us is not None:
        marks.append((limit_name, limit_us, palette.WITHOUT))
    right = np.log10(edges[-1] / edges[0]) if log_x else edges[-1] - edges[0]
    for row, (name, value, colour) in enumerate(marks):
        place = max(value, floor) * shown.factor if log_x else value * shown.factor
        at = float(np.log10(place)) if log_x else place
        share = (np.log10(place / edges[0]) if log_x else place - edges[0]) / right
        label = f"{name} {written(value, 'us', printed=True)}"
        height = 1.25 - 0.075 * row
        figure.add_shape(
            type="line", x0=place, x1=place, y0=0, y1=height, xref="x", yref="paper",
            line={"color": colour, "width": 1, "dash": "dot"},
        )  # fmt: skip
        figure.add_annotation(
            x=at, y=height, xref="x", yref="paper", text=label, showarrow=False,
            xanchor="left" if share < 0.6 else "right", yanchor="top", xshift=3 if share < 0.6 else -3,
            font={"size": 12, "color": colour},
        )  # fmt: skip
    figure.update_yaxes(
        c.logarithmic(0.5, max(float(counts.max()), 2.0) * 1.5, room=0.0, least=1.0), title_standoff=8
    )
    if log_x:
        figure.update_xaxes(c.logarithmic(float(edges[0]), float(edges[-1]), room=0.0))
    c.note(figure, f"{us.size} ticks.")
    return figure


def lateness_figure(lateness_us: npt.ArrayLike, *, period_us: float | None = None) -> go.Figure:
    """Return the histogram of lateness (us after the deadline), log counts, with p50, p99, p99.9 and max.

    `period_us` draws the tick's period beside it. Values that are not finite are left out.
    """
    return _histogram(lateness_us, "Lateness", period_us, "period")


def execution_figure(execution_us: npt.ArrayLike, *, period_us: float | None = None) -> go.Figure:
    """Return the histogram of execution times of a tick (us), as `lateness_figure`."""
    return _histogram(execution_us, "Execution time", period_us, "period")
