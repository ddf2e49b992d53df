"""What a recording could have shown: from which size on each effect would pass the one test."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.effects import Candidate
from rtcomp.diagnosis.candidates.screening import look
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.regression import RIDGE
from rtcomp.diagnosis.numerics.significance import Null
from rtcomp.diagnosis.result import Sight
from rtcomp.diagnosis.settings import LEVEL


def sights(
    fitter: Fitter,
    fitted: Fitted,
    null: Null | None,
    beside: Sequence[Candidate] | None = None,
    ends: float = math.inf,
) -> list[Sight]:
    """Return from which size on effects would have been seen beside a fitted model.

    To first order: the part of its force that the model cannot make up for, against the gain that chance
    makes in one of a hundred recordings. Of an effect at several starting values, the plainest counts.
    `beside` are all candidates beside the model, where they are known; else those made up to the time `ends`.
    """
    balance = fitter.balance
    made = beside or look(fitter, fitted, ends).candidates
    use = fitter.rows
    model = fitted.free_columns[:, use]
    norm = np.sqrt(np.einsum("ij,ij->i", model, model))
    model = model / np.where(norm > 0.0, norm, 1.0)[:, None]
    gram = model @ model.T + RIDGE * np.eye(model.shape[0])
    needed = fitted.sse * math.expm1(null.threshold(LEVEL) if null is not None else 0.1)
    found: dict[str, Sight] = {}
    for c in made:
        column = c.columns[0][use]
        with_model = model @ column
        left = float(column @ column - with_model @ np.linalg.solve(gram, with_model))
        one = _sight(balance, c, math.sqrt(needed / left) if left > 0.0 else math.inf)
        if one is not None and (one.name not in found or one.smallest < found[one.name].smallest):
            found[one.name] = one
    return list(found.values())


def _sight(balance: ForceBalance, candidate: Candidate, times: float) -> Sight | None:
    """Return the size that is so many `times` the candidate's first column."""
    entry, part = candidate.term.entry, candidate.parts[0]
    kind = ent.kind_of(entry)
    size = next((n for n in kind.linear if n in part and part[n] != entry.get(n)), None)
    if size is None:
        size = next((n for n in kind.linear if n in part), "")
    if not size:
        return None
    p = ent.parameter(kind, size)
    away = abs(float(part[size]) - ent.neutral(kind, size))
    beside = {
        k: float(v) for k, v in part.items() if k not in ("name", "form", size) and isinstance(v, int | float)
    }
    return Sight(kind.name, size, p.unit, times * away, _most(balance, p.unit, p.high), beside)


def _most(balance: ForceBalance, unit: str, high: float) -> float:
    """Return the largest size of a unit that is plausible on a recording."""
    data = balance.data
    volts = float(np.abs(np.concatenate([s.voltage for s in data.segments])).max())
    span = data.stroke[1] - data.stroke[0]
    speed = float(max(np.abs(p.v).max() for p in balance.paths())) or 1.0
    force = volts * balance.stage.force_constant
    scale = {
        "N": force, "V": volts, "m": span, "N/m": force / span, "N/m^3": force / span**3, "N m": force,
        "N s/m": force / speed, "N s^2/m^2": force / speed**2, "s": data.last / 4.0, "1/m": 1.0 / span,
        "1": 1.0,
    }.get(unit, high)  # fmt: skip
    return min(scale, high)
