"""What each entry of the catalogue would have gained, and what the named ones did gain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import plotly.graph_objects as go

from rtcomp.report import palette
from rtcomp.report.figures import canvas as c
from rtcomp.report.quantities import si

_UNSEEN = "cannot be seen"


class Bar(NamedTuple):
    """One candidate: the share of the mismatch it would explain, whether it was named, could be seen."""

    name: str
    gain: float
    named: bool = False
    observable: bool = True


def candidates_figure(bars: Sequence[Bar]) -> go.Figure:
    """Return a bar for each candidate in the order given, in % of the mismatch; not observable ones grey."""
    figure = c.canvas(
        c.titled("Explained alone", "%"), "", height=110 + 27 * max(len(bars), 1),
        unified=False,
    )  # fmt: skip
    if not bars:
        c.say_if_empty(figure, [])
        return figure
    other = [b for b in bars if not b.named]
    groups = (
        ("named", palette.WITH, palette.INK, [b for b in bars if b.named]),
        ("not named", palette.MEASURED, palette.INK, [b for b in other if b.observable]),
        (_UNSEEN, palette.AXIS, palette.MUTED, [b for b in other if not b.observable]),
    )
    for label, colour, ink, group in groups:
        if group:
            figure.add_bar(
                x=[100 * max(b.gain, 0.0) for b in group], y=[c.safe(b.name) for b in group], orientation="h",
                name=label, marker={"color": colour}, textfont={"color": ink}, showlegend=label != _UNSEEN,
                text=[f"{max(100 * b.gain, 0.0):.3g} %" if b.observable else label for b in group],
                textposition="outside", cliponaxis=False, hovertemplate="%{y}: %{text}<extra></extra>",
            )  # fmt: skip
    largest = max(100 * max(b.gain, 0.0) for b in bars)
    figure.update_xaxes(range=[0, max(1.18 * largest, 1.0)])
    figure.update_yaxes(
        autorange="reversed", showgrid=False, ticks="", categoryorder="array",
        categoryarray=[c.safe(b.name) for b in bars],
    )  # fmt: skip
    figure.update_layout(barmode="overlay", bargap=0.3)
    return figure


def fit_figure(errors: Mapping[str, float], floor: float) -> go.Figure:
    """Return relative force errors (1) by name as bars in %, with a line at the floor that noise sets."""
    figure = c.canvas(
        c.titled("Relative force error on parts not seen in fitting", "%"), "", height=120 + 42 * len(errors),
        unified=False,
    )  # fmt: skip
    colours = [palette.WITHOUT, palette.MEASURED, palette.WITH]
    largest = 100 * max([*errors.values(), floor])
    for (name, error), colour in zip(errors.items(), colours, strict=False):
        # A figure that the line would cross stands behind it.
        crossed = 0.0 <= 100 * (floor - error) < 0.09 * largest
        figure.add_bar(
            x=[100 * error], y=[c.safe(name)], orientation="h", marker={"color": colour}, showlegend=False,
            text=si(100 * error, "%"), textposition="none" if crossed else "outside", cliponaxis=False,
            hovertemplate="%{text}<extra></extra>",
        )  # fmt: skip
        if crossed:
            figure.add_annotation(
                x=100 * floor, y=c.safe(name), xanchor="left", xshift=3, showarrow=False,
                text=si(100 * error, "%"), font={"color": palette.INK, "size": 12},
            )  # fmt: skip
    figure.add_shape(
        type="line", x0=100 * floor, x1=100 * floor, yref="paper", y0=0, y1=1,
        line={"color": palette.INK, "width": 1, "dash": "dash"},
    )  # fmt: skip
    figure.add_annotation(
        xanchor="left" if 200 * floor < largest else "right",
        x=100 * floor, yref="paper", y=1, yanchor="bottom", showarrow=False,
        text=f"noise alone: {si(100 * floor, '%')}", font={"color": palette.INK, "size": 12},
    )  # fmt: skip
    figure.update_xaxes(range=[0, max(1.15 * largest, 1e-9)])
    figure.update_yaxes(autorange="reversed", showgrid=False, ticks="")
    figure.update_layout(margin={"t": 34}, bargap=0.35)
    return figure
