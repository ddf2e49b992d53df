"""Whether an effect shows in the objective that its model was not fitted to.

A model fitted to forces is asked in simulated positions, one fitted to positions in forces. What is really
missing shows in both; what one of them was bent to fit does not show in the other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.replicated import replicated
from rtcomp.diagnosis.numerics.robust import shows
from rtcomp.diagnosis.numerics.significance import SURE
from rtcomp.diagnosis.positions.windows import GROUPS, Windows
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats

LEAST, MOST = 0.5, 1.5
"""Part of what an effect does below which nothing is the better guess, above which twice as much is."""


def denied(fitter: Fitter, model: Fitted, without: Fitted) -> bool:
    """Tell whether what `model` does beyond the one `without` does not show in the other objective.

    Only where it would if `model` were right, as a replicate of it tells: behind a play, noise of the reading
    kicks the load another way each time, and the right model does not show.
    """
    balance = fitter.balance
    windows = Windows.of(balance) if fitter.by_force else None
    try:
        if there(*(errors(fitter, m, windows) for m in (model, without))):
            return False
    except ConfigError:  # no stage has its numbers, so none moves by it
        return True
    data = replicated(fitter, model)
    if data is None:
        return False
    other = fitter.on(data)
    same = windows and windows.on(other.balance)
    again = [other.fit(list(m.terms), m, steps=0) for m in (model, without)]
    return there(*(errors(other, m, same) for m in again))


def there(having: Sequence[Floats], without: Sequence[Floats]) -> bool:
    """Tell whether the part that shows is plainly more than nothing, and nearer to all of it than to nothing.

    Where plainly more than all of it is there, something else is.
    """
    part, error = shows(having, without)
    return part > max(LEAST, SURE * error) and part - SURE * error < MOST


def errors(fitter: Fitter, model: Fitted, windows: Windows | None) -> list[Floats]:
    """Return a model's errors by the objective that it was not fitted to, each (rows,), reserved left out.

    Of position (m) in each of the short simulated `windows`; or without these, as position was fitted to, of
    force (N) in each block.
    """
    if windows is not None:
        return list(windows.off(fitter.stage(model))[windows.block < GROUPS])
    balance, force = fitter.balance, fitter.force(model)
    return [force[balance.block == block] for block in np.flatnonzero(~balance.reserved)]
