"""The law by which elements of friction yield: as believed, or another that leaves less."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.replicated import replicated
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.significance import log_gain
from rtcomp.diagnosis.settings import LEAST_GAIN, NEGLIGIBLE

STOP, SOLID = 0.0, 1.0
"""Exponents of Dahl's law: of a stop, which yields at its reach at once, and of a solid that nears it."""
RANGE, SETTLED = (0.25, 3.0), 0.02
"""Exponents of a solid, and how well the best of them is found."""
ASIDE = (0.8, 1.25)
"""Exponents that show whether another than SOLID leaves less."""


def law_of(fitter: Fitter, terms: Sequence[Term]) -> float:
    """Return the exponent by which `terms` leave least: that at hand, or one that leaves less.

    Less by what an effect must gain to matter, or noise where the one at hand leaves more. A believed model
    of friction has its own law; friction that hardly holds a force has none that could be told. Numbers of
    `terms` move with it, and the last may be of another form: what suits one law may hide another.
    """
    balance = fitter.balance
    if balance.models.size:
        return balance.exponent
    was, other = (STOP, SOLID) if balance.exponent == STOP else (SOLID, STOP)

    def beside(exponent: float) -> tuple[Fitter, Fitted]:
        at_hand = exponent == balance.exponent
        return (fitter, fitter.fit(terms)) if at_hand else _by(fitter, exponent, terms)

    first, second = shared(beside, (was, other))
    if not _holds(balance, first[1]):
        return balance.exponent
    to_other = _less(first, second) or _explains_more(first, second)
    law, best = (other, second) if to_other else (was, first)
    return law if law == STOP else _settled(*best)


def _holds(balance: ForceBalance, model: Fitted) -> bool:
    """Tell whether the friction of a model holds a part of the drive's force (rms) that matters."""
    return model.level > NEGLIGIBLE * float(np.sqrt(np.mean(balance.drive_force() ** 2)))


def _by(fitter: Fitter, exponent: float, terms: Sequence[Term]) -> tuple[Fitter, Fitted]:
    """Return `terms` fitted beside friction of an exponent, the last in the form that leaves least."""
    other = _of(fitter, exponent)
    forms = [term.with_entry(entry) for term in terms[-1:] for entry in ent.in_other_forms(term.entry)]
    ways = [terms, *([*terms[:-1], form] for form in forms)]
    return other, min(shared(other.fit, ways), key=lambda model: model.sse)


def _of(fitter: Fitter, exponent: float) -> Fitter:
    other = fitter.on(fitter.balance.data)
    other.balance.exponent = exponent
    return other


def _less(one: tuple[Fitter, Fitted], other: tuple[Fitter, Fitted]) -> bool:
    """Tell whether the other model leaves less by what matters, each beside friction of its own law."""
    first = one[0].force(one[1])
    before, after = (fitter.relative(model, seen=True, first=first) ** 2 for fitter, model in (one, other))
    gained = log_gain(one[1].errors, other[1].errors)
    return gained > 2.0 * LEAST_GAIN and before - after > NEGLIGIBLE**2


def _explains_more(one: tuple[Fitter, Fitted], other: tuple[Fitter, Fitted]) -> bool:
    """Tell whether most of what the other model leaves is noise, most of what the one leaves is not.

    And whether it is likelier, by the variance that its replicates have. Friction that yields within a few
    counts forgets by motion that no reading tells: replicates of one law leave that, of the other less.
    """
    noise, others = shared(lambda way: _noise(*way), (one, other))
    if not 0.0 < 2.0 * noise < one[1].sse or 2.0 * others <= other[1].sse:
        return False
    return math.log(others) + other[1].sse / others < math.log(noise) + one[1].sse / noise


def _noise(fitter: Fitter, model: Fitted) -> float:
    """Return the squared error that a model leaves of a replicate of its own; 0 where there is none."""
    data = replicated(fitter, model)
    return 0.0 if data is None else fitter.on(data).fit(model.terms, model, steps=0).sse


def _settled(solid: Fitter, model: Fitted) -> float:
    """Return the exponent that leaves least at the numbers of a model by SOLID, that if no less matters."""

    def at(exponent: float) -> tuple[Fitter, Fitted]:
        other = _of(solid, exponent)
        return other, other.fit(model.terms, steps=0)

    def gain(exponent: float) -> float:
        return log_gain(model.errors, at(exponent)[1].errors)

    if max(shared(gain, ASIDE)) <= 0.0:
        return SOLID
    from scipy.optimize import minimize_scalar

    best = minimize_scalar(lambda e: -gain(e), bounds=RANGE, method="bounded", options={"xatol": SETTLED})
    exponent = float(best.x)
    return exponent if _less((solid, model), at(exponent)) else SOLID
