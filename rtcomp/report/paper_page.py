"""What `rtcomp paper` shows: the claims, true or false, and every figure beside what the paper reports."""

from __future__ import annotations

import math
import platform

import numpy as np

from rtcomp import __version__
from rtcomp.jobs.paper.claim import Claim, Spread
from rtcomp.jobs.paper.figures import Remade
from rtcomp.jobs.paper.study import Study
from rtcomp.report.columns import Columns
from rtcomp.report.figures.traces import traces_figure
from rtcomp.report.page import Page, Section


def number(value: float) -> str:
    """Return a number in three digits; what is infinite, such as cycles that no training took, is never."""
    return f"{value:.3g}" if math.isfinite(value) else "never"


def spread(value: Spread, unit: str) -> str:
    """Return ``1.56 times (0.857 to never)``, median and range over the seeds, if any."""
    middle = f"{number(value.median)} {unit}" if math.isfinite(value.median) else "never reached"
    if value.low == value.high:
        return middle
    return f"{middle} ({number(value.low)} to {number(value.high)})"


def verdict(claim: Claim) -> str:
    """Return whether the claim holds, as it is printed."""
    return "true" if claim.holds else "false"


def claim_rows(done: Study) -> list[tuple[str, str, str, str, bool]]:
    """Return the claims for the terminal: name, the paper, number, what it is, whether it holds."""
    return [(c.name, c.paper, spread(c.value, c.unit), c.quantity, c.holds) for c in done.claims]


def paper_page(done: Study) -> Page:
    """Return the page of `rtcomp paper`."""
    true = sum(c.holds for c in done.claims)
    setup = (
        f"the recording {done.recording} stands in for the real setup in Figs. 10 to 12; Figs. 13b, 14b and "
        "15 need a closed loop and are simulated"
        if done.recording
        else "the real setup is a simulated stage with flaws of the size of Fig. 11"
    )
    return Page(
        title="The paper's figures and claims, made anew",
        subtitle="Non-local hysteresis function identification and compensation with neural networks",
        verdict=[
            f"Of {len(done.claims)} claims of the text {true} are true here and {len(done.claims) - true} "
            "are not.",
            f"Throughout, {setup}.",
        ],
        notes=[
            f"The paper gives no learning factor. Step {done.step:g} (over the mean squared norm of the "
            "activations) needs about its 60 cycles in the ideal case and is taken everywhere; the "
            f"fastest, {done.fastest:g}, is beside it where it matters.",
            f"Median and range over {done.effort.seeds} seeds ({done.effort.loops} in closed loop); never: "
            f"not within {done.effort.most} cycles.",
        ],
        sections=[
            Section("The claims", "", None, _claims(done)),
            *[_figure(f) for f in done.figures],
            Section("How each claim was tested", "", None, _told(done)),
        ],
        versions={"rtcomp": __version__, "Python": platform.python_version(), "numpy": np.__version__},
    )


def _claims(done: Study) -> Columns:
    rows = [[c.name, c.paper, verdict(c), spread(c.value, c.unit), c.quantity] for c in done.claims]
    return Columns(["claim", "the paper says", "here", "number", "what it is"], rows, figures=(2,))


def _told(done: Study) -> Columns:
    rows = [[c.name, c.criterion, c.measured, c.remark] for c in done.claims]
    return Columns(["claim", "true if", "measured on", "remark"], rows)


def _figure(remade: Remade) -> Section:
    return Section(
        f"Fig. {remade.number}: {remade.title}",
        f"The paper: {remade.paper}.\n\nHere: {remade.here}\n\nFrom: {remade.source}.",
        traces_figure([(t.name, t.x, t.y, t.role) for t in remade.traces], remade.x, remade.y),
    )
