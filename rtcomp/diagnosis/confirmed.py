"""What the other objective says of a model: simulated position where forces judged, or forces.

What is really missing shows in both. What one of them was bent to fit does not show in the other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis.fit import Fitter
from rtcomp.diagnosis.fitted import Fitted
from rtcomp.diagnosis.replicate import replicate
from rtcomp.diagnosis.windows import GROUPS, Windows
from rtcomp.kernels import Floats

HALF = 0.5
"""Part of what an effect does below which nothing at all is the better guess."""


def denied(fitter: Fitter, model: Fitted, without: Fitted) -> bool:
    """Tell whether what `model` does beyond the one `without` does not show in the other objective.

    Only where it would if `model` were right: it is compared with what shows in a replicate. Where noise of
    the reading kicks a load within its play, there is nothing to compare.
    """
    balance = fitter.balance
    windows = Windows.of(balance) if fitter.by_force else None
    shown = shows(*(errors(fitter, m, windows) for m in (model, without)))
    if shown >= HALF:
        return False
    stage = fitter.stage(model, between=True)
    motion = [path.x for path in balance.paths()]
    data = replicate(stage, balance.data, motion, balance.read_noise(stage), 0)
    if data is None:
        return False
    other = fitter.on(data)
    same = windows and windows.on(other.balance)
    again = [other.fit(list(m.terms), m, steps=0) for m in (model, without)]
    return shown < HALF * shows(*(errors(other, m, same) for m in again))


def shows(having: Sequence[Floats], without: Sequence[Floats]) -> float:
    """Return the part of what a model does beyond another one that the errors of both, each (rows,), show.

    1 where all of it does, 0 where nothing does, about a half where errors are much larger than it. It is the
    least-squares factor, over windows or blocks that count alike: one that went far off says no more.
    """
    there = done = 0.0
    for own, other in zip(having, without, strict=True):
        size = max(float(np.mean(own**2) + np.mean(other**2)), 1e-300)
        there += float(np.sum(other * (other - own))) / size
        done += float(np.sum((other - own) ** 2)) / size
    return there / max(done, 1e-300)


def errors(fitter: Fitter, model: Fitted, windows: Windows | None) -> list[Floats]:
    """Return a model's errors by the objective that it was not fitted to, each (rows,), reserved left out.

    Of position (m) in each of the short simulated `windows`; or without these, as position was fitted to, of
    force (N) in each block.
    """
    if windows is not None:
        return list(windows.off(fitter.stage(model))[windows.block < GROUPS])
    balance, force = fitter.balance, fitter.force(model)
    return [force[balance.block == block] for block in np.flatnonzero(~balance.reserved)]
