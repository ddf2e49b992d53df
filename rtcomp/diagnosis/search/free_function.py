"""A force that is any function of one thing, as a rival of effects.

A name has no rival outside the catalogue. Where more than noise is left beside it, an unknown cause makes
that rest, and may make all of it. What goes by one thing (position, speed, time, ...) by a law that nobody
knows is such a cause: where it takes away more than an effect in any form, the effect stands in for it. So do
several together: a wave, a stop and a spring that are a bump of force.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.other_forms import SMOOTH, errors_beside, of_position
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.mismatch.locate import axes_of
from rtcomp.diagnosis.mismatch.where import Compared, as_white
from rtcomp.diagnosis.numerics.significance import log_gain
from rtcomp.kernels import Floats

KNOTS = 16
"""Knots of a function at quantiles of what it goes by, joined by straight lines."""


def rival(fitter: Fitter, without: Fitted, errors: Floats, replaced: Sequence[tuple[Entry, Floats]]) -> str:
    """Return what a force goes by that explains more than some effects, "" where there is none.

    It stands in the place of those `replaced`, entries with their forces (N, (n,)), beside a model `without`
    them. `errors` (B_use,) are those of the effects in any form; as large as the largest of them the function
    is believed to be. A spring by any law is a spring: of what alone is a smooth function of the position,
    another one is a form. And beside laws that no number bends, as a damping by direction, what explains more
    is a further effect.
    """
    size = max(float(np.std(force)) for _, force in replaced)
    if not np.isfinite(size) or size == 0.0:
        return ""
    balance = fitter.balance
    laws = [as_white(balance, force) for entry, force in replaced if not ent.shape_parameters(entry)]
    spring = len(replaced) == 1 and of_position(balance, replaced[0][0]).size > 0
    gains = {
        name: log_gain(errors, errors_beside(fitter, without, size * columns))
        for name, columns in _functions(balance)
        if not (name == "position" and spring)
        and not (len(laws) == len(replaced) and all(_one_of(columns, law) for law in laws))
    }
    best = max(gains, key=lambda name: gains[name], default="")
    return best if best and gains[best] > 0.0 else ""


def _one_of(columns: Floats, law: Floats) -> bool:
    """Tell whether a law (n,) is one of the functions that whitened columns (q, n) span."""
    rest = law - np.linalg.lstsq(columns.T, law, rcond=None)[0] @ columns
    return bool(np.linalg.norm(rest) < SMOOTH * np.linalg.norm(law))


def _functions(balance: ForceBalance) -> Iterator[tuple[str, Floats]]:
    """Go through what a force may go by, and the whitened columns (q, n) of any function of it, of size 1.

    Of all that a mismatch is located along but for the command: in a loop all forces go by that. Of the
    position also with the sign of the motion, as friction does, and times the speed, as damping.
    """
    axes = axes_of(Compared(balance), balance.stage.axis)
    speed = next(axis.values for axis in axes if axis.name == "speed")
    for axis in axes:
        tents = _tents(axis.values)
        if axis.name == "command" or not tents.size:
            continue
        signed = tents if axis.odd is None else tents * axis.odd
        yield axis.name + (" and direction" if axis.odd is not None else ""), _white(balance, signed)
        if axis.name == "position" and axis.odd is None:
            damping = tents * (speed / max(float(np.abs(speed).max()), 1e-300))
            yield "position, times speed", _white(balance, damping)


def _white(balance: ForceBalance, columns: Floats) -> Floats:
    return np.array([as_white(balance, column) for column in columns])


def _tents(values: Floats) -> Floats:
    """Return functions (q, n) that span all that are straight between knots; none of one value."""
    knots = np.unique(np.quantile(values, np.linspace(0.0, 1.0, KNOTS)))
    if knots.size < 2:
        return np.zeros((0, values.size))
    return np.array([np.interp(values, knots, unit) for unit in np.eye(knots.size)])
