"""By how much a held command acts before its own row: a property of the recording, not of the axis.

Nothing moves before it is pushed. But a log that reads the axis late within its row looks so, and a
simulation that moves on by the speed at the end of its step does. Beside a resonance, a fortieth of a row is
more than noise, and the nearest physics would be named for it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.replicated import replicated
from rtcomp.diagnosis.numerics.robust import shows
from rtcomp.diagnosis.numerics.significance import SURE
from rtcomp.diagnosis.settings import LEFT
from rtcomp.kernels import Floats


def put_in_step(fitter: Fitter, terms: Sequence[Term]) -> None:
    """Let the command act as early as a model of `terms` shows, where that explains what the model leaves.

    Beside a wrong model it may seem early as well, and then leaves more than an effect may (`LEFT`). What a
    fit finds on a replicate of the model, whose command acts at its row, is the method's own error.
    """
    balance = fitter.balance
    if not balance.data.held:
        return
    if balance.data.early:  # a poorer model may have bent it
        balance.act_early(0.0)
    model = fitter.fit(terms, steps=0)
    rows, error = early(fitter, model)
    if rows < SURE * error:
        return
    data = replicated(fitter, model)
    if data is None:
        return
    other = fitter.on(data)
    again = other.fit(terms, model, steps=0)
    own, own_error = early(other, again)
    rows -= own
    if rows < SURE * math.hypot(error, own_error):
        return
    moved, more = math.inf, rows
    beside = model
    while abs(more) < moved and abs(more) > error:  # what is left goes by the square of the rows
        moved = abs(more)
        balance.act_early(min(max(rows, 0.0), 1.0))
        beside = fitter.fit(terms, model, steps=0)
        more = early(fitter, beside)[0] - own
        rows = balance.data.early + more
    noise = again.sse
    if beside.sse - noise > LEFT * (model.sse - noise):
        balance.act_early(0.0)


def early(fitter: Fitter, model: Fitted) -> tuple[float, float]:
    """Return the rows by which the command acts earlier yet beside a model, and their standard error.

    To first order: the drive's force is of second order in the rows, so a difference over a row to both sides
    is its slope. What the model's own numbers can make of it is left out of it.
    """
    balance = fitter.balance
    columns = model.system.columns[model.coefficients != 0.0]
    both = [balance.on(replace(balance.data, early=balance.data.early + way)) for way in (1.0, -1.0)]
    before, after = (b.error(model.entries, model.coefficients, model.weights) for b in both)
    moved, rows = 0.5 * (before - after), fitter.rows
    sizes = np.linalg.lstsq(columns[:, rows].T, moved[rows], rcond=1e-9)[0]
    moved = moved - sizes @ columns
    return shows(_by_block(fitter, model.residual + moved), _by_block(fitter, model.residual))


def _by_block(fitter: Fitter, residual: Floats) -> list[Floats]:
    edges = np.searchsorted(fitter.block, np.arange(fitter.blocks + 1))
    return [residual[edges[i] : edges[i + 1]] for i in np.flatnonzero(fitter.use)]
