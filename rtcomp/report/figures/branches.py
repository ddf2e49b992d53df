"""A hysteresis cut into its branches: the loop, the mirrored loop, all branches from a common origin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go

from rtcomp.report import palette
from rtcomp.report.decimate import Floats, peak_indices
from rtcomp.report.figures import canvas as c
from rtcomp.report.quantities import scale, typeset

Path = tuple[npt.ArrayLike, npt.ArrayLike]
"""Position (travel) and force of one branch, of one length."""

BRANCHES = 60
"""Branches of each direction that are drawn at most, evenly taken."""
_EACH = 200
_LOOKS = {
    "rising": (palette.MEASURED, "solid"),
    "falling": (palette.MODEL, "dash"),
    "left out": (palette.REFERENCE, "dot"),
}


def branches_figure(
    rising: Sequence[Path],
    falling: Sequence[Path],
    left_out: Sequence[Path] = (),
    *,
    unit: str = "m",
    force_unit: str = "N",
    x: str = "Position",
    y: str = "Force",
) -> go.Figure:
    """Return branches as lines, coloured by direction: position (`unit`) and force (`force_unit`) of each.

    With travel and the force gained in place of position and force this is the congruency test (the paper's
    Fig. 11b). At most BRANCHES of each direction are drawn, and it is said. Raises ValueError where the two
    arrays of a branch differ in length.
    """
    parts = {
        name: [(c.floats(a), c.floats(b)) for a, b in given]
        for name, given in (("rising", rising), ("falling", falling), ("left out", left_out))
    }
    every = [one for some in parts.values() for one in some]
    for along, up in every:
        c.same_length(position=along, force=up)
    fx, fy = scale(unit, *[a for a, _ in every]), scale(force_unit, *[b for _, b in every])
    figure = c.canvas(c.titled(x, fx.unit), c.titled(y, fy.unit), height=460, unified=False)
    if c.say_if_empty(figure, [b for _, b in every], "no branches"):
        return figure
    where = f"%{{x:.4g}} {typeset(fx.unit)}, %{{y:.4g}} {typeset(fy.unit)}"
    for name, some in parts.items():
        if not some:
            continue
        colour, dash = _LOOKS[name]
        drawn = [
            some[i] for i in np.unique(np.linspace(0, len(some) - 1, min(BRANCHES, len(some))).astype(int))
        ]
        xs, ys = _joined(drawn, fx.factor, fy.factor)
        c.line(
            figure, xs, ys, name, colour, width=1.2, dash=dash, opacity=0.75 if name != "left out" else 0.5,
            hovertemplate=where,
        )  # fmt: skip
        if len(drawn) < len(some):
            c.note(
                figure, f"Of {len(some)} {name} branches {len(drawn)} are drawn, evenly over the recording."
            )
    return figure


def mirrored_figure(
    loop: Sequence[Path], mirrored: Sequence[Path], *, unit: str = "m", force_unit: str = "N"
) -> go.Figure:
    """Return a loop, its branches solid, and its point reflection dashed (the paper's Fig. 11a).

    Positions (`unit`) and forces (`force_unit`) are from the loop's centre. A symmetric loop shows one line.
    """
    parts = [[(c.floats(a), c.floats(b)) for a, b in some] for some in (loop, mirrored)]
    every = [one for some in parts for one in some]
    fx, fy = scale(unit, *[a for a, _ in every]), scale(force_unit, *[b for _, b in every])
    figure = c.canvas(
        c.titled("Position from the loop's centre", fx.unit),
        c.titled("Force from the loop's centre", fy.unit), height=460, unified=False,
    )  # fmt: skip
    if c.say_if_empty(figure, [b for _, b in every], "no loop"):
        return figure
    where = f"%{{x:.4g}} {typeset(fx.unit)}, %{{y:.4g}} {typeset(fy.unit)}"
    looks = (
        ("main loop", palette.MEASURED, 3.5, "solid", 0.6),
        ("mirrored", palette.MODEL, 1.8, "dash", 1.0),
    )
    for (name, colour, width, dash, opacity), some in zip(looks, parts, strict=True):
        xs, ys = _joined(some, fx.factor, fy.factor)
        c.line(figure, xs, ys, name, colour, width=width, dash=dash, opacity=opacity, hovertemplate=where)
    return figure


def difference_figure(
    place: npt.ArrayLike, difference: npt.ArrayLike, scatter: float, *, unit: str = "m"
) -> go.Figure:
    """Return by how much a loop is asymmetric along it, in % of its force half-range, with its two parts.

    `place` (`unit`) is the distance from the loop's centre, symmetric about 0. The band is the `scatter`
    (%, rms) of repeats of one branch, NaN where there are none.
    """
    x, d = c.floats(place), c.floats(difference)
    c.same_length(place=x, difference=d)
    fx = scale(unit, x)
    figure = c.canvas(
        c.titled("Position from the loop's centre, of the rising branch", fx.unit),
        "Rising less mirrored falling (%)", height=320,
    )  # fmt: skip
    if c.say_if_empty(figure, [d], "no loop"):
        return figure
    even = 0.5 * (d + d[::-1])
    c.line(figure, x * fx.factor, d, "difference", palette.MEASURED, width=2.4)
    c.line(figure, x * fx.factor, even, "in the mean curve", palette.WITH, dash="dash")
    c.line(figure, x * fx.factor, d - even, "in the opening", palette.MODEL, dash="dot")
    if np.isfinite(scatter):
        figure.add_hrect(y0=-scatter, y1=scatter, fillcolor=palette.REFERENCE, opacity=0.15, line_width=0)
        c.note(figure, "Grey: the rms difference of two repeats of one branch.")
    return figure


def _joined(some: Sequence[tuple[Floats, Floats]], fx: float, fy: float) -> tuple[Floats, Floats]:
    """Return several paths as one, thinned, with gaps between."""
    xs, ys = [], []
    for along, up in some:
        kept = peak_indices([along, up], _EACH)
        xs += [along[kept] * fx, np.array([np.nan])]
        ys += [up[kept] * fy, np.array([np.nan])]
    return np.concatenate(xs), np.concatenate(ys)
