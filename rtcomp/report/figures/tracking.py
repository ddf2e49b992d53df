"""Tracking error with and without compensation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from rtcomp.report import palette
from rtcomp.report.decimate import Floats, peak_indices
from rtcomp.report.figures import canvas as c
from rtcomp.report.quantities import scale, written

_NAMES = {"without": "without compensation", "with": "with compensation"}
_COLOURS = {"without": palette.WITHOUT, "with": palette.WITH}


class Figures(NamedTuple):
    """Size of an error, in its own unit; NaN where there is no finite sample."""

    rms: float
    peak: float


def rms_and_peak(error: npt.ArrayLike) -> Figures:
    """Return root mean square and largest magnitude of the finite samples of `error`, in its unit."""
    values = c.floats(error)
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return Figures(float("nan"), float("nan"))
    return Figures(float(np.sqrt(np.mean(finite**2))), float(np.max(np.abs(finite))))


def tracking_figure(
    without: tuple[npt.ArrayLike, npt.ArrayLike] | None,
    compensated: tuple[npt.ArrayLike, npt.ArrayLike] | None,
    *,
    unit: str = "m",
    points: int = c.POINTS,
    names: tuple[str, str] = (_NAMES["without"], _NAMES["with"]),
) -> go.Figure:
    """Return the tracking error (reference minus position) with and without compensation against time.

    Each is (time in s, error in `unit`) or None. The upper panel has both on one scale; the lower one, drawn
    where both are given, shows the compensated error on its own scale. Rms and peak stand in the legend,
    beside the `names` of the two.
    """
    runs: dict[str, tuple[Floats, Floats]] = {}
    for key, run in (("without", without), ("with", compensated)):
        if run is not None:
            runs[key] = (c.floats(run[0]), c.floats(run[1]))
            c.same_length(time=runs[key][0], error=runs[key][1])
    in_time = scale("s", *(t for t, _ in runs.values()))
    drawn_in = scale(unit, *(e for _, e in runs.values()))
    title = "Tracking error"
    figure = c.canvas(c.titled("Time", in_time.unit), c.titled(title, drawn_in.unit))
    if c.say_if_empty(figure, [e for _, e in runs.values()]):
        return figure
    for key, (t, e) in runs.items():
        kept = peak_indices([e], points)
        size = rms_and_peak(e)
        rms, peak = (written(value, unit, printed=True) for value in size)
        label = f"{names[key == 'with']}: rms {rms}, peak {peak}"
        x = t[kept] * in_time.factor
        c.line(figure, x, e[kept] * drawn_in.factor, label, _COLOURS[key], width=1.4)
        c.note_thinned(figure, len(kept), len(t))
        if key == "with" and len(runs) == 2 and np.isfinite(e).any():
            own = scale(unit, e)
            figure.update_layout(
                height=560,
                yaxis={"domain": [0.47, 1.0]},
                yaxis2=c.axis(
                    c.titled("enlarged", own.unit), domain=[0.0, 0.37], anchor="x", hoverformat=".4g"
                ),
                xaxis={"anchor": "y2"},
            )
            c.line(
                figure, x, e[kept] * own.factor, label, _COLOURS[key], width=1.1, yaxis="y2", showlegend=False
            )
    figure.update_layout(hovermode="closest")
    return figure


def error_bars_figure(sizes: dict[str, Figures], *, unit: str = "m") -> go.Figure:
    """Return rms and peak of several runs as bars on a log axis, each labelled with its number.

    `sizes` maps a run's name (``"without"`` and ``"with"`` have their colours) to its `Figures` in `unit`.
    """
    values = c.floats([v for size in sizes.values() for v in size])
    shown = values[np.isfinite(values) & (values > 0.0)]
    drawn_in = scale(unit, shown)
    figure = c.canvas(
        c.titled("Tracking error", drawn_in.unit), "", height=130 + 46 * max(len(sizes), 1), unified=False
    )
    if shown.size == 0:
        c.say_if_empty(figure, [])
        return figure
    for index, (name, size) in enumerate(sizes.items()):
        colour = _COLOURS.get(name, palette.series(index)[0])
        for what, value, opacity in (("rms", size.rms, 1.0), ("peak", size.peak, 0.5)):
            figure.add_bar(
                x=[value * drawn_in.factor if value > 0.0 else None], y=[f"{c.safe(name)}, {what}"],
                orientation="h", marker={"color": colour, "opacity": opacity}, showlegend=False,
                text=written(value, unit, printed=True), textposition="outside", cliponaxis=False,
                hovertemplate="%{text}<extra></extra>",
            )  # fmt: skip
    low, high = float(shown.min()) * drawn_in.factor, float(shown.max()) * drawn_in.factor
    # Bars on a log axis have no natural foot: a factor of three below the smallest, the same for all.
    figure.update_xaxes(c.logarithmic(low / 3.0, high * 1.6 * (high / low) ** 0.25, room=0.0))
    figure.update_yaxes(autorange="reversed", showgrid=False, ticks="")
    figure.update_layout(margin={"t": 30}, bargap=0.3)
    return figure
