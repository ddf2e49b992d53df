"""The law by which elements of friction yield: as believed, or another that leaves less."""

from __future__ import annotations

from collections.abc import Sequence

from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.numerics.significance import log_gain
from rtcomp.diagnosis.settings import LEAST_GAIN, NEGLIGIBLE

STOP, SOLID = 0.0, 1.0
"""Exponents of Dahl's law: of a stop, which yields at its reach at once, and of a solid that nears it."""
RANGE, SETTLED = (0.25, 3.0), 0.02
"""Exponents of a solid, and how well the best of them is found."""


def law_of(fitter: Fitter, terms: Sequence[Term]) -> float:
    """Return the exponent by which `terms` leave least: that at hand, or one that leaves less.

    Less by what an effect must gain to matter. A believed model of friction has its own law.
    """
    balance = fitter.balance
    at_hand = fitter.fit(terms, steps=0)
    if balance.models.size or not at_hand.coefficients[balance.friction].any():
        return balance.exponent

    def by(exponent: float) -> tuple[Fitter, Fitted]:
        other = fitter.on(balance.data)
        other.balance.exponent = exponent
        return other, other.fit(terms, steps=0)

    def less(other: Fitter, model: Fitted) -> bool:
        gained = fitter.relative(at_hand, seen=True) ** 2 - other.relative(model, seen=True) ** 2
        return log_gain(at_hand.errors, model.errors) > 2.0 * LEAST_GAIN and gained > NEGLIGIBLE**2

    if balance.exponent != STOP and less(*by(STOP)):
        return STOP
    if balance.exponent == STOP and not less(*by(SOLID)):
        return STOP
    from scipy.optimize import minimize_scalar

    best = minimize_scalar(
        lambda exponent: -log_gain(at_hand.errors, by(exponent)[1].errors),
        bounds=RANGE, method="bounded", options={"xatol": SETTLED},
    )  # fmt: skip
    exponent = float(best.x)
    return exponent if less(*by(exponent)) else balance.exponent
