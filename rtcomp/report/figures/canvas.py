"""What all figures share: layout, axes with units, lines that stay small in the file."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from rtcomp.report import palette
from rtcomp.report.decimate import Floats
from rtcomp.report.quantities import si, typeset

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
POINTS = 4000
"""Points a curve has at most; about 40 kB a curve in the page."""


def floats(values: npt.ArrayLike) -> Floats:
    """Return `values` as a flat array of float64."""
    return np.asarray(values, dtype=np.float64).reshape(-1)


def same_length(**arrays: Floats | None) -> None:
    """Raise ValueError naming the arrays where those given differ in length."""
    lengths = {name: len(a) for name, a in arrays.items() if a is not None}
    if len(set(lengths.values())) > 1:
        raise ValueError(
            "arrays of one figure differ in length: " + ", ".join(f"{k} {v}" for k, v in lengths.items())
        )


def compact(values: Floats) -> npt.NDArray[Any]:
    """Return `values` as float32 where the eye cannot tell, which halves them in the page."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return values.astype(np.float32)
    largest = float(np.max(np.abs(finite)))
    fine = largest < 1e30 and float(np.ptp(finite)) > 1e-2 * largest
    return values.astype(np.float32) if fine or largest == 0.0 else values


def safe(text: str) -> str:
    """Return text for a figure: plotly reads some HTML in names and titles, files must not write it."""
    return html.escape(text, quote=False)


def titled(name: str, unit: str) -> str:
    """Return an axis title, ``Position (µm)``; a dimensionless one has no bracket."""
    shown = typeset("" if unit == "1" else unit)
    return f"{safe(name)} ({safe(shown)})" if shown else safe(name)


def axis(title: str, **more: Any) -> dict[str, Any]:
    """Return the layout of one axis."""
    return {
        "title": {"text": title, "standoff": 8, "font": {"size": 13}},
        "gridcolor": palette.GRID,
        "linecolor": palette.AXIS,
        "tickcolor": palette.AXIS,
        "zeroline": False,
        "showline": True,
        "ticks": "outside",
        "ticklen": 4,
        "automargin": True,
        "exponentformat": "power",
        **more,
    }


def canvas(x: str, y: str, *, height: int = 360, unified: bool = True) -> go.Figure:
    """Return an empty figure with the two axis titles and the house's layout."""
    figure = go.Figure()
    figure.update_layout(
        template="none",
        height=height,
        margin={"l": 68, "r": 18, "t": 52, "b": 54},
        font={"family": FONT, "size": 13, "color": palette.INK},
        # Without a fill: the page's own background, light or dark, shines through.
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        hovermode="x unified" if unified else "closest",
        modebar={"bgcolor": "rgba(0,0,0,0)", "color": palette.AXIS, "activecolor": palette.MEASURED},
        hoverlabel={"bgcolor": palette.PAPER, "bordercolor": palette.AXIS, "font": {"color": palette.INK}},
        legend={"orientation": "h", "x": 0, "xanchor": "left", "y": 1.02, "yanchor": "bottom"},
        showlegend=True,
        xaxis=axis(x, hoverformat=".5g"),
        yaxis=axis(y, hoverformat=".4g"),
        meta={"notes": []},
    )
    return figure


def note(figure: go.Figure, text: str) -> None:
    """Add a sentence to what the page writes under the figure."""
    figure.update_layout(meta={"notes": [*figure.layout.meta["notes"], text]})


def note_thinned(figure: go.Figure, drawn: int, rows: int) -> None:
    """Say that not all of the rows are drawn, where they are not."""
    if drawn < rows:
        note(figure, f"Of {rows} samples, the peaks of each short stretch are drawn.")


def padded(values: Floats, share: float = 0.03) -> list[float]:
    """Return an axis range around the finite `values` with a little room on both sides."""
    finite = values[np.isfinite(values)]
    low, high = float(finite.min()), float(finite.max())
    room = share * (high - low) or 0.05 * max(abs(high), 1e-12)
    return [low - room, high + room]


def logarithmic(low: float, high: float, *, room: float = 0.06, least: float = 0.0) -> dict[str, Any]:
    """Return the layout of a log axis from `low` to `high` (> 0), ticks (from `least`) as plain numbers."""
    bottom, top = float(np.log10(low)), float(np.log10(high))
    span = max(top - bottom, 0.3)
    steps = (1, 2, 5) if span <= 2.5 else (1,)
    decades = range(int(np.floor(bottom)) - 1, int(np.ceil(top)) + 2)
    ticks = [m * 10.0**k for k in decades for m in steps if m * 10.0**k >= least]
    return {
        "type": "log",
        "range": [bottom - room * span, top + room * span],
        "tickvals": ticks,
        "ticktext": [si(tick) for tick in ticks],
    }


def line(
    figure: go.Figure,
    x: Floats,
    y: Floats,
    name: str,
    colour: str,
    *,
    width: float = 1.6,
    dash: str = "solid",
    **more: Any,
) -> None:
    """Add a line without markers; NaN breaks it."""
    figure.add_scatter(
        x=compact(x),
        y=compact(y),
        name=name,
        mode="lines",
        line={"color": colour, "width": width, "dash": dash},
        connectgaps=False,
        **more,
    )


def say_if_empty(figure: go.Figure, arrays: Sequence[Floats | None], what: str = "no data") -> bool:
    """Write `what` across the figure where none of the arrays holds a finite value; return whether it did."""
    if any(a is not None and bool(np.isfinite(a).any()) for a in arrays):
        return False
    figure.add_annotation(
        text=safe(what), x=0.5, y=0.5, xref="paper", yref="paper", showarrow=False,
        font={"color": palette.MUTED, "size": 15},
    )  # fmt: skip
    figure.update_layout(showlegend=False)
    return True
