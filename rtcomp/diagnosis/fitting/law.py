"""The law by which elements of friction yield: as believed, or another that leaves less."""

from __future__ import annotations

from collections.abc import Sequence

from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.numerics.significance import log_gain
from rtcomp.diagnosis.settings import LEAST_GAIN, NEGLIGIBLE

LAWS = (0.0, 1.0)
"""Exponents of Dahl's law: a stop, which yields at its reach at once, and a solid that nears its level."""


def law_of(fitter: Fitter, terms: Sequence[Term]) -> float:
    """Return the exponent by which `terms` leave least: that at hand, or one that leaves less.

    Less by what an effect must gain to matter. A believed model of friction has its own law.
    """
    balance = fitter.balance
    model = fitter.fit(terms, steps=0)
    if balance.models.size or not model.coefficients[balance.friction].any():
        return balance.exponent
    for exponent in LAWS:
        if exponent != balance.exponent:
            other = fitter.on(balance.data)
            other.balance.exponent = exponent
            there = other.fit(terms, steps=0)
            less = fitter.relative(model, seen=True) ** 2 - other.relative(there, seen=True) ** 2
            if log_gain(model.errors, there.errors) > 2.0 * LEAST_GAIN and less > NEGLIGIBLE**2:
                return exponent
    return balance.exponent
