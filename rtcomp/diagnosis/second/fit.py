"""Fit of a model: linear coefficients and nonlinear parameters together, and its error on blocks left out.

Variable projection (Golub and Pereyra 1973): a step moves the nonlinear parameters by Gauss and Newton with
the linear coefficients free, then these are solved again within their bounds. Blocks are left out on the
problem linearised there, with all parameters refitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.second import entries as ent
from rtcomp.diagnosis.second.balance import BASE, ForceBalance, System
from rtcomp.diagnosis.second.entries import Entry
from rtcomp.diagnosis.second.free import Free, Term, free_of
from rtcomp.diagnosis.second.regression import Grams, Prior
from rtcomp.diagnosis.second.settings import BELIEF_SD
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats

STEPS = 10
"""Gauss-Newton steps at most."""
SETTLED = 1e-4
"""Relative gain of a step below which the fit ends."""
ONCE = 0.5
"""Part of a column's power in one block, from which on the other blocks cannot tell its size."""


@dataclass(frozen=True)
class Fitted:
    """A model fitted on the blocks that are not reserved."""

    terms: tuple[Term, ...]
    coefficients: Floats
    """(p,): base, then sizes of entries that add a force, in the units of the columns."""
    system: System
    prior: Prior
    residual: Floats
    """(n,), whitened, all rows."""
    tangents: Floats
    """(q, n): change of the model with each free nonlinear parameter (on its scale)."""
    free: tuple[Free, ...]
    errors: Floats
    """(B_use,): squared error of each block left out."""
    without: Floats
    """(B_use, p + q): coefficients and nonlinear changes without each block."""
    sse: float
    """Squared error of all blocks that are not reserved, in sample."""
    variance: float
    weights: Floats
    """N/m of the friction units."""

    @property
    def size(self) -> int:
        """Number of parameters of its effects."""
        return sum(len(t.free) for t in self.terms)

    @property
    def at_bound(self) -> bool:
        """Tell whether a nonlinear parameter of the last term came out at its bound."""
        last = len(self.terms) - 1
        return any(f.at_bound(self.terms) for f in self.free if f.term == last)

    @property
    def entries(self) -> list[Entry]:
        """Return the entries with the values found."""
        return [t.entry for t in self.terms]


class Fitter:
    """Fits models of one force balance."""

    def __init__(self, balance: ForceBalance) -> None:
        self.balance = balance
        self.offset = False
        """Whether a constant force that nobody believes is fitted beside every model."""
        self._believed = [Term.of(e) for e in balance.believed]

    @property
    def use(self) -> np.ndarray:
        """Blocks to fit, (blocks,) bool: those that are not reserved."""
        return ~self.balance.reserved

    def prior(self, system: System, terms: Sequence[Term]) -> Prior:
        """Return what is believed of the columns: mass, damping near the belief, no negative stiffness."""
        balance, m = self.balance, self.balance.stage.mechanics
        size = system.columns.shape[0]
        mean, precision = np.zeros(size), np.zeros(size)
        low, high = np.full(size, -np.inf), np.full(size, np.inf)
        low[: balance.size] = 0.0
        for i, value in enumerate((m.mass, m.viscous, m.micro_damping)):
            if value > 0.0:
                mean[i], precision[i] = value, (BELIEF_SD * value) ** -2
            elif balance.without(BASE[i]):
                high[i] = 0.0
        low[0] = 1e-3 * m.mass
        if balance.believed_speed is None:
            high[balance.faster] = 0.0
        else:
            off = math.log(balance.believed_speed / m.micro_damping_speed)
            mean[balance.faster], low[balance.faster] = m.micro_damping * off, -np.inf
            precision[balance.faster] = (BELIEF_SD * m.micro_damping) ** -2
        if self.offset and not balance.biased and not any(ent.kind_of(t.entry).bias for t in terms):
            low[balance.size - 1] = -np.inf
        else:
            high[balance.size - 1] = 0.0
        for term, span in zip([*self._believed, *terms], system.of_entry, strict=True):
            if span.stop > span.start:
                low[span], high[span] = ent.bounds_of(term.entry)
        for term, span in zip(self._believed, system.of_entry, strict=False):
            sizes = ent.sizes_of(term.entry)
            near = sizes != 0.0
            where = np.arange(span.start, span.stop)
            mean[where[near]] = sizes[near]
            precision[where[near]] = (BELIEF_SD * np.abs(sizes[near])) ** -2
        return Prior(mean, precision, low, high)

    def solve(
        self, terms: Sequence[Term], weights: Floats, variance: float
    ) -> tuple[System, Prior, Grams, Floats, float]:
        """Return the system of `terms`, its prior, statistics, coefficients and squared error in sample."""
        b = self.balance
        system = b.system([t.entry for t in terms], weights)
        prior = self.prior(system, terms)
        grams = Grams.of(system.columns, system.y, b.block, b.blocks)
        c = grams.solve(self.use, prior, variance)
        return system, prior, grams, c, float(grams.errors(c, self.use).sum())

    def quick(self, terms: Sequence[Term]) -> float:
        """Return the squared error in sample of `terms` as they are, with believed friction at work."""
        weights = self.balance.weights
        for _ in range(2):
            _, _, _, c, sse = self.solve(terms, weights, 1.0)
            weights = c[self.balance.friction]
        return sse

    def fit(self, terms: Sequence[Term], start: Fitted | None = None, steps: int = STEPS) -> Fitted:
        """Fit a model from the values that its terms have; raise ConfigError where these are impossible."""
        b = self.balance
        current = list(terms)
        weights = b.weights
        if start is not None and start.weights.size == b.reaches.size and not _newly_behind(terms, start):
            weights = start.weights
        rows = np.isin(b.block, np.flatnonzero(self.use))
        variance = 1.0 if start is None else start.variance
        for _ in range(2):
            system, prior, _, c, sse = self.solve(current, weights, variance)
            variance = sse / max(int(rows.sum()), 1)
            weights = c[b.friction]
        free = free_of(current, b)
        damping = 1e-3
        tangents = np.zeros((0, system.y.size))
        for _ in range(steps if free else 0):
            tangents = self._tangents(current, free, system, c, weights)
            wide = prior.extended(np.full(len(free), -np.inf), np.full(len(free), np.inf))
            joint = Grams.of(np.concatenate([system.columns, tangents]), system.y, b.block, b.blocks)
            power = np.diag(joint.gram[self.use].sum(axis=0))[c.size :]
            improved = False
            for _ in range(4):
                held = np.concatenate([wide.precision[: c.size], damping * power / max(variance, 1e-300)])
                moved = joint.solve(self.use, Prior(wide.mean, held, wide.low, wide.high), variance)[c.size :]
                trial = list(current)
                for f, step in zip(free, moved.tolist(), strict=True):
                    most = 0.7 if f.log else max(0.5 * abs(f.get(current)), 20.0 * f.step)
                    f.put(trial, f.get(current) + min(max(step, -most), most))
                try:
                    found = self.solve(trial, weights, variance)
                except ConfigError:
                    damping *= 10.0
                    continue
                if found[-1] < sse:
                    improved = True
                    break
                damping *= 10.0
            if not improved:
                break
            gained = 1.0 - found[-1] / sse
            current = trial
            system, prior, _grams, c, sse = found
            weights = c[b.friction]
            variance = sse / max(int(rows.sum()), 1)
            damping = max(0.1 * damping, 1e-6)
            free = free_of(current, b)
            if gained < SETTLED:
                break
        return self._finished(current, free, system, prior, c, sse, variance, weights)

    def _finished(
        self,
        terms: list[Term],
        free: list[Free],
        system: System,
        prior: Prior,
        c: Floats,
        sse: float,
        variance: float,
        weights: Floats,
    ) -> Fitted:
        b = self.balance
        tangents = self._tangents(terms, free, system, c, weights)
        wide = prior.extended(np.full(len(free), -np.inf), np.full(len(free), np.inf))
        joint = Grams.of(np.concatenate([system.columns, tangents]), system.y, b.block, b.blocks)
        whole = np.concatenate([c, np.zeros(len(free))])
        errors, without = left_out(joint, self.use, wide, variance, whole)
        done = []
        for term, span in zip(terms, system.of_entry[len(self._believed) :], strict=True):
            sizes = c[span]
            done.append(term.with_entry(ent.composed(term.entry, sizes)) if sizes.size else term)
        residual = system.y - c @ system.columns
        return Fitted(
            tuple(done), c, system, prior, residual, tangents, tuple(free), errors, without, sse, variance,
            weights,
        )  # fmt: skip

    def _tangents(
        self, terms: list[Term], free: Sequence[Free], system: System, c: Floats, weights: Floats
    ) -> Floats:
        """Return what the model changes by with each free parameter, (q, n), coefficients held."""
        rest = system.y - c @ system.columns

        def one(f: Free) -> Floats:
            for way in (1.0, -1.0):
                trial = list(terms)
                f.put(trial, f.get(terms) + way * f.step)
                moved = f.get(trial) - f.get(terms)
                if moved == 0.0:
                    continue
                try:
                    other = self.balance.error([t.entry for t in trial], c, weights)
                except ConfigError:
                    continue
                return (rest - other) / moved
            return np.zeros_like(rest)

        return np.array(shared(one, free)) if free else np.zeros((0, system.y.size))


def _newly_behind(terms: Sequence[Term], start: Fitted) -> bool:
    """Tell whether friction comes to be behind a play, which a fit without one takes for longer reaches."""
    return any(ent.kind_of(t.entry).behind for t in terms) and not any(
        ent.kind_of(t.entry).behind for t in start.terms
    )


def left_out(
    grams: Grams, use: np.ndarray, prior: Prior, variance: float, whole: Floats
) -> tuple[Floats, Floats]:
    """Return squared errors (B_use,) of blocks predicted by the others, and coefficients without each.

    What happens in one block only keeps the size that it has in the `whole` fit there: other blocks cannot
    tell it.
    """
    members = np.flatnonzero(use)
    power = np.einsum("kii->ki", grams.gram[use])
    alone = power > ONCE * np.maximum(power.sum(axis=0), 1e-300)
    errors, found = np.empty(members.size), []
    for i, k in enumerate(members):
        others = use.copy()
        others[k] = False
        held = prior
        if alone[i].any():
            low, high = prior.low.copy(), prior.high.copy()
            low[alone[i]] = high[alone[i]] = whole[alone[i]]
            held = Prior(prior.mean, prior.precision, low, high)
        c = grams.solve(others, held, variance)
        errors[i] = grams.errors(c, np.array([k]))[0]
        found.append(c)
    return errors, np.array(found)
