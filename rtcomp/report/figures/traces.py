"""Curves over each other as they are, loops included: the figures of a paper made anew."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from rtcomp.report import palette
from rtcomp.report.decimate import path_indices
from rtcomp.report.figures import canvas as c
from rtcomp.report.quantities import scale

_POINTS = 3000


def traces_figure(
    curves: Sequence[tuple[str, npt.ArrayLike, npt.ArrayLike, str]],
    x: tuple[str, str],
    y: tuple[str, str],
    *,
    height: int = 400,
) -> go.Figure:
    """Return curves, each (name, x, y, role) with x and y of one length, which need not rise along x.

    `x` and `y` name the axes: title and unit. The first curve is drawn broad and pale, so that the next stays
    visible where they agree. A `role` of the palette fixes a curve's colour. NaN breaks a line. Raises
    ValueError
    where lengths differ.
    """
    xs, ys = [c.floats(k[1]) for k in curves], [c.floats(k[2]) for k in curves]
    along, up = scale(x[1], *xs), scale(y[1], *ys)
    figure = c.canvas(c.titled(x[0], along.unit), c.titled(y[0], up.unit), height=height, unified=False)
    if c.say_if_empty(figure, ys):
        return figure
    thinned = False
    for index, ((name, _, _, role), u, v) in enumerate(zip(curves, xs, ys, strict=True)):
        c.same_length(x=u, y=v)
        colour, dash = (palette.ROLES[role], "solid") if role else palette.series(index)
        whole = bool(np.isfinite(u).all() and np.isfinite(v).all())
        kept = path_indices([u, v], _POINTS) if whole and u.size > _POINTS else np.arange(u.size)
        thinned |= len(kept) < u.size
        first = index == 0 and len(curves) > 1
        c.line(
            figure, u[kept] * along.factor, v[kept] * up.factor, c.safe(name), colour,
            width=4.5 if first else 1.6, dash=dash, opacity=0.55 if first else 1.0,
        )  # fmt: skip
    if thinned:
        c.note(figure, "Drawn with fewer points than samples, all reversals and peaks kept.")
    figure.update_xaxes(range=c.padded(np.concatenate(xs) * along.factor))
    return figure
