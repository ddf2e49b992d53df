"""Position and force against time."""

from __future__ import annotations

import numpy.typing as npt
import plotly.graph_objects as go

from rtcomp.report import palette
from rtcomp.report.decimate import Floats, peak_indices
from rtcomp.report.figures import canvas as c
from rtcomp.report.quantities import scale


def _against_time(
    time: npt.ArrayLike, curves: list[tuple[str, Floats, str, float, str]], title: str, unit: str, points: int
) -> go.Figure:
    t = c.floats(time)
    c.same_length(time=t, **{name: y for name, y, *_ in curves})
    in_time = scale("s", t)
    drawn_in = scale(unit, *(y for _, y, *_ in curves))
    figure = c.canvas(c.titled("Time", in_time.unit), c.titled(title, drawn_in.unit))
    if c.say_if_empty(figure, [y for _, y, *_ in curves]):
        return figure
    kept = peak_indices([y for _, y, *_ in curves], points)
    for name, y, colour, width, dash in curves:
        # What lies below is broad and pale, so that the line on it stays visible where they agree.
        c.line(
            figure, t[kept] * in_time.factor, y[kept] * drawn_in.factor, name, colour, width=width, dash=dash,
            opacity=1.0 if len(curves) == 1 or width < 2.0 else 0.5,
        )  # fmt: skip
    c.note_thinned(figure, len(kept), len(t))
    return figure


def position_figure(
    time: npt.ArrayLike,
    position: npt.ArrayLike,
    reference: npt.ArrayLike | None = None,
    *,
    unit: str = "m",
    points: int = c.POINTS,
) -> go.Figure:
    """Return position (measured) and, where there is one, reference against time.

    `time` in s; `position` and `reference` of the same length in `unit` (``"m"`` or ``"rad"``). NaN breaks a
    line. At most about `points` rows are drawn, peaks kept. Raises ValueError where lengths differ.
    """
    curves = [("measured", c.floats(position), palette.MEASURED, 1.6, "solid")]
    if reference is not None:
        curves.insert(0, ("reference", c.floats(reference), palette.REFERENCE, 4.5, "solid"))
    return _against_time(time, curves, "Position", unit, points)


def force_figure(
    time: npt.ArrayLike,
    measured: npt.ArrayLike,
    model: npt.ArrayLike | None = None,
    *,
    unit: str = "N",
    title: str = "Force",
    name: str = "measured",
    points: int = c.POINTS,
) -> go.Figure:
    """Return measured and, where there is one, modelled force against time.

    `time` in s; forces of the same length in `unit` (``"N"``, ``"N m"``, or ``"V"`` with another `title` and
    another `name` for the first curve).
    """
    curves = [(name, c.floats(measured), palette.MEASURED, 1.6 if model is None else 4.5, "solid")]
    if model is not None:
        curves.append(("model", c.floats(model), palette.MODEL, 1.4, "solid"))
    return _against_time(time, curves, title, unit, points)
