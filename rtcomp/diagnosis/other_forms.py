"""What other forms of a model's effects would do: their forces, bent along what they may depend on.

The kernels of the catalogue are not the only forms that an effect may have. Where its form is another, its
force times a smooth function of position, speed, time or of itself makes up for most of it, and for a wave
the same over a period. What only does the same is no further effect.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.balance import ForceBalance
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitted import Fitted, left_out
from rtcomp.diagnosis.regression import Grams
from rtcomp.diagnosis.where import as_white
from rtcomp.kernels import Floats

if TYPE_CHECKING:
    from rtcomp.diagnosis.fit import Fitter

WAVES = 2
"""Waves in a period by which one is bent."""


def other_forms(balance: ForceBalance, entry: Entry, force: Floats) -> Floats:
    """Return the whitened columns (q, n) of an entry's `force` (N, (n,)), bent by functions of size 1."""
    most = float(np.abs(force).max(initial=0.0))
    if not np.isfinite(most) or most == 0.0:
        return np.zeros((0, force.size))
    return np.array([as_white(balance, force * bend) for bend in _bends(balance, entry, force / most)])


def errors_beside(fitter: Fitter, model: Fitted, forms: Floats) -> Floats:
    """Return the squared errors (B_use,) of blocks left out, with other forms (q, n) beside a model.

    A form is believed to differ by about the effect's own size.
    """
    if not forms.size:
        return model.errors
    system = model.system
    columns = np.concatenate([system.columns, model.tangents, forms])
    joint = Grams.of(columns, system.y, fitter.block, fitter.blocks)
    some = np.full(columns.shape[0] - model.prior.low.size, np.inf)
    prior = model.prior.extended(-some, some)
    prior.precision[-forms.shape[0] :] = 1.0
    whole = joint.solve(fitter.use, prior, model.variance)
    return left_out(joint, fitter.use, prior, model.variance, whole)[0]


def _bends(balance: ForceBalance, entry: Entry, force: Floats) -> Iterator[Floats]:
    """Go through smooth functions (n,) between -1 and 1 of what a force may depend on."""
    paths = balance.paths()
    position = balance.plain([p.x for p in paths])
    time = balance.plain([s.time for s in balance.data.segments])
    for signal in (position, balance.plain([p.v for p in paths]), time, force):
        low, high = float(signal.min()), float(signal.max())
        at = (2.0 * signal - low - high) / max(high - low, 1e-300)
        yield at
        yield 1.5 * at**2 - 0.5
    if ent.PERIOD in entry and any(p.unit == ent.PHASE for p in ent.kind_of(entry).parameters):
        for k in range(1, WAVES + 1):
            angle = 2.0 * np.pi * k / float(entry[ent.PERIOD]) * position
            yield np.sin(angle)
            yield np.cos(angle)
