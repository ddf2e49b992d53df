"""Starts: the values from which each effect is fitted where first order is no guide to what it does."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Parameter

TIMES = (0.1, 0.3, 3.0, 10.0)
"""Times the size that first order has, at which an effect is tried too."""
POINTS = 10
"""Values of its nonlinear parameters, the likeliest first, from which an effect is tried."""
FEW = 3
"""Steps after which starts are compared."""
FULL = 0.9
"""Part of its bound to which a size is cut that first order makes larger."""
STARTS = 2
"""Likeliest values of an effect of which the better ones, as they are, are fitted."""


def as_they_are(left: Callable[[Term], float], families: Sequence[Sequence[Term]], ends: float) -> list[Term]:
    """Return one term of each family: of those likeliest to first order that with which least is `left`.

    What is far from first order, as a reading that jumps further than friction yields, shows only as it is
    which of its values is right; what first order makes too large, at half of it.
    """

    def tried(term: Term) -> float:
        try:
            return left(term) if clock.now() < ends else math.inf
        except (ConfigError, np.linalg.LinAlgError):
            return math.inf

    some = [[t for term in terms[:STARTS] for t in (term, *_halved(term))] for terms in families]
    errors = iter(shared(tried, [term for terms in some for term in terms]))
    return [
        min(zip([next(errors) for _ in terms], terms, strict=True), key=lambda one: one[0])[1]
        for terms in some
    ]


class Stepped(Protocol):
    """What fits a model step by step, all its numbers at once."""

    @property
    def rows(self) -> np.ndarray:
        """Rows of the residual that are fitted, (n,) bool."""

    def residual(self, c: Floats, terms: Sequence[Term]) -> Floats:
        """Return the residual (n,) of numbers `c` (p,) and `terms`; raise ConfigError where out of range."""

    def moved(
        self, c: Floats, terms: list[Term], steps: int, *, entries: bool, slopes: Floats | None = None
    ) -> tuple[Floats, list[Term], float]:
        """Return numbers and terms after `steps`, and what they leave; `slopes` are of a model nearby."""


def likeliest(
    fitter: Stepped, model: Fitted, families: Sequence[Sequence[Term]], count: int, ends: float
) -> list[Term]:
    """Return `count` terms, two starts of each family that leaves least beside a model after a few steps.

    The best come first. Each family has its terms, the likeliest to first order first. What friction can take
    up, as a band without force, is nothing to first order: the largest that leaves no more is tried too.
    """
    begun = _begun(fitter, model)
    starts = [(i, term) for i, terms in enumerate(shared(begun, families)) for term in terms]

    def tried(start: tuple[int, Term]) -> tuple[float, Term]:
        if clock.now() > ends:
            return math.inf, start[1]
        try:
            terms, slopes = [*model.terms, start[1]], model.system.columns
            _, moved, left = fitter.moved(model.coefficients, terms, FEW, entries=True, slopes=slopes)
        except (ConfigError, np.linalg.LinAlgError):
            return math.inf, start[1]
        return left, moved[-1]

    of_family: dict[int, list[tuple[float, Term]]] = {}
    for (i, _), one in zip(starts, shared(tried, starts), strict=True):
        of_family.setdefault(i, []).append(one)
    best = sorted(of_family.values(), key=lambda found: min(left for left, _ in found))
    return [term for found in best for left, term in found if math.isfinite(left)][:count]


def _begun(fitter: Stepped, model: Fitted) -> Callable[[Sequence[Term]], list[Term]]:
    """Return what gives a family's starts: its likeliest at the size that leaves least, and its largest."""
    rest = model.residual[fitter.rows]
    span, _ = np.linalg.qr(np.concatenate([model.system.columns, model.tangents])[:, fitter.rows].T)

    def begun(family: Sequence[Term]) -> list[Term]:
        sizes = _sizes_of(family[0])
        found = []
        for term in [*sizes, *family[1:POINTS]]:
            try:
                other = fitter.residual(model.coefficients, [*model.terms, term])[fitter.rows]
            except ConfigError:
                continue
            left = float(np.sum(other**2))
            beside = left - float(np.sum((other @ span) ** 2))
            found.append((left, beside, float(np.sum((other - rest) ** 2)), term))
        best = min((f for f in found if f[3] in sizes), key=lambda one: one[0], default=None)
        most = max((f for f in found if f[1] < model.sse), key=lambda one: one[2], default=None)
        return [one[3] for one in (best, most if most is not best else None) if one is not None]

    return begun


def within(p: Parameter, value: float, entry: Entry) -> float:
    """Return a size (of the parameter `p`) within its bounds in the form of an entry, and not at them."""
    return min(max(value, FULL * p.lowest), FULL * ent.highest(entry, p))


def _halved(term: Term) -> list[Term]:
    """Return a term at half its size, where that was cut."""
    solved = ent.adds_force(ent.kind_of(term.entry))
    return [_resized(term, 0.5)] if not solved and term == _resized(term, 1.0 / FULL) else []


def _sizes_of(term: Term) -> list[Term]:
    """Return a term at its own and at smaller and larger sizes."""
    return [term, *(_resized(term, times) for times in TIMES)]


def _resized(term: Term, times: float) -> Term:
    """Return a term with so many times its size, within its bounds."""
    kind, entry = ent.kind_of(term.entry), dict(term.entry)
    for p in kind.parameters:
        if p.name in kind.linear and p.name in entry:
            neutral = ent.neutral(kind, p.name)
            value = neutral + times * (float(entry[p.name]) - neutral)
            entry[p.name] = within(p, value, entry)
    return term.with_entry(entry)
