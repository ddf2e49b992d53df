"""Fit of a model: linear coefficients and nonlinear parameters together, and its error on blocks left out.

Variable projection (Golub and Pereyra 1973): a step moves the nonlinear parameters by Gauss and Newton with
the linear coefficients free, then these are solved again within their bounds. Blocks are left out on the
problem linearised there, with all parameters refitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.cache import KEPT_ONCE, Cache
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting import starting
from rtcomp.diagnosis.fitting.at_hand import (
    by_weights,
    consistent,
    goes_by_whole,
    newly_behind,
    system_around,
    tangents_of,
)
from rtcomp.diagnosis.fitting.believed import as_held, prior_of
from rtcomp.diagnosis.fitting.fitted import Fitted, left_out
from rtcomp.diagnosis.fitting.free import Free, Term, changed, free_of
from rtcomp.diagnosis.fitting.other_forms import other_beliefs, other_forms, variants
from rtcomp.diagnosis.fitting.retuned import level_and_reach
from rtcomp.diagnosis.fitting.solved import Posed, Solved
from rtcomp.diagnosis.fitting.stage_of import stage_of
from rtcomp.diagnosis.forces.balance import BASE, ForceBalance
from rtcomp.diagnosis.forces.noise import Noise
from rtcomp.diagnosis.mismatch.where import as_force, as_seen, as_white
from rtcomp.diagnosis.numerics.regression import Grams, Prior, System
from rtcomp.diagnosis.recordings.data import Data
from rtcomp.diagnosis.result import PositionFit
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Effect
from rtcomp.stage.stage import Stage

STEPS = 10
"""Gauss-Newton steps at most."""
SETTLED = 1e-4
"""Relative gain of a step below which the fit ends."""
TURNS = 6
"""Turns at most in which friction is refitted that what goes by it was made for."""


class Fitter:
    """One objective, here the force balance: what a model leaves of it, and fits of models to it."""

    by_force = True
    """Whether forces are balanced: friction is a grid of units, and what effects change adds up."""

    def __init__(self, balance: ForceBalance) -> None:
        self.balance = balance
        self.offset = False
        """Whether a constant force that nobody believes is fitted beside every model."""
        self._believed = [Term.of(e) for e in balance.believed]
        self._forms = Cache(KEPT_ONCE)

    @property
    def use(self) -> np.ndarray:
        """Blocks to fit, (blocks,) bool: those that are not reserved."""
        return ~self.balance.reserved

    @property
    def block(self) -> np.ndarray:
        """Block of each row of the residual, (n,), sorted."""
        return self.balance.block

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return self.balance.blocks

    @property
    def rows(self) -> np.ndarray:
        """Rows of the residual that are not reserved, (n,) bool."""
        return np.asarray(self.use[self.block])

    @property
    def power(self) -> float:
        """Squared residual of blocks that are not reserved if nothing at all were explained."""
        return self.balance.power

    def linear(self, kind: type[Effect]) -> bool:
        """Tell whether the sizes of an effect are coefficients, so that any start value of them will do."""
        return ent.adds_force(kind)

    def rough(self, model: Fitted, families: Sequence[Sequence[Term]], count: int, ends: float) -> list[Term]:
        """Return terms of `count` families worth a full fit; the likeliest come first there and in each."""
        return starting.as_they_are(lambda term: self.quick([*model.terms, term]), families[:count], ends)

    def units(self, entries: Sequence[Entry]) -> Floats:
        """Return the columns (q, n) of unit sizes of the last of `entries`, which is `linear`."""
        return self.balance.forces_of(entries)

    def change(self, model: Fitted, entry: Entry) -> Floats:
        """Return by how much more a model accounts for with an entry at work, (n,), coefficients held."""
        b = self.balance
        return model.residual - b.error([*model.entries, entry], model.coefficients, model.weights)

    def stage(self, model: Fitted, *, between: bool = False) -> Stage:
        """Return a model as a stage; `between`: with friction that its own grid does not quite reach."""
        return stage_of(self.balance, model, between=between)

    def force(self, model: Fitted) -> Floats:
        """Return the force (N) that a model leaves open on the compared rows of the balance."""
        return as_force(self.balance, model.residual)

    def whitened(self, model: Fitted) -> Floats:
        """Return that force whitened, (n,): each frequency over its noise."""
        return model.residual if self.by_force else as_white(self.balance, self.force(model))

    def without(self, model: Fitted, at: int) -> Floats:
        """Return the force (N) that a model leaves open without its effect number `at`, others as are."""
        b = self.balance
        others = [*model.entries[:at], *model.entries[at + 1 :]]
        span = model.system.of_entry[len(b.believed) + at]
        c = np.delete(model.coefficients, np.arange(span.start, span.stop))
        return as_force(b, b.error(others, c, model.weights))

    def other_forms(self, model: Fitted, besides: str) -> Floats:
        """Return the columns (q, n) of what other forms of its effects do, but of that which is `besides`."""
        own = [self.forms_of(model, i) for i in range(len(model.terms))]
        return np.concatenate([other_beliefs(self.balance, model, besides), *own])

    def other_friction(self, model: Fitted) -> Floats:
        """Return the columns (q, n) of friction of another shape than believed: none, the grid's is free."""
        return np.zeros((0, model.residual.size))

    def forms_of(self, model: Fitted, at: int) -> Floats:
        """Return the columns (q, n) of what other forms of its effect number `at` do."""
        made = self._forms.of(model, lambda: [other_forms(self, model, i) for i in range(len(model.terms))])
        return np.asarray(made[at])

    def variants(self, model: Fitted, at: int) -> Floats:
        """Return the columns (q, n) that another form of its effect number `at` would add by its own law."""
        made = self._forms.of(("variants", model, at), lambda: [variants(self, model, at)])
        return np.asarray(made[0])

    def relative(self, model: Fitted, *, seen: bool = False, first: Floats | None = None) -> float:
        """Return what a model leaves over what there is, rms, not reserved; `seen`: above the noise.

        Rows count as far as motion tells what friction does there. `first` is the force (N, (n,)) with which
        this is compared (`as_seen`).
        """
        b, left, given = self.balance, self.force(model), self.balance.drive_force()
        if seen:
            left, given = as_seen(b, left, first), as_seen(b, given)
        left, given = ((b.trust * f)[self.rows] for f in (left, given))
        return math.sqrt(np.mean(left**2) / max(np.mean(given**2), 1e-300))

    def left_by(self, stage: Stage) -> Floats:
        """Return what any stage leaves as it is in each row, (n,), over what there is to explain (rms)."""
        drive, needed = self.balance.both_sides(stage)
        return np.asarray(drive - needed) / math.sqrt(max(np.mean(drive[self.rows] ** 2), 1e-300))

    def has_offset(self, model: Fitted) -> bool:
        """Tell whether a model has a constant force beside its entries."""
        return bool(model.coefficients[self.balance.size - 1] != 0.0)

    def louder(self, model: Fitted) -> float:
        """Return how many times louder noise may be by what a model leaves, where none is stated."""
        b = self.balance
        if Noise.stated(b.stage) > 0.0:
            return 1.0
        sizes = [s.time[b.whitening.rows(s)].size for s in b.data.segments]
        return b.whitening.louder(np.split(model.residual, np.cumsum(sizes)[:-1]), b.noise, b.data)

    def above_noise(self, model: Fitted, louder: float = 1.0, noise: float = math.inf) -> float:
        """Return that relative error (rms) above that of noise, so many times `louder`.

        `noise` is the squared error of replicates: counts of a slow axis are not white, and may be less.
        """
        weight = self.balance.trust**2
        power = float(np.sum(weight * self.balance.drive_force() ** 2) / np.sum(weight))
        white, left = self.balance.noise_power / max(power, 1e-300), self.relative(model) ** 2
        if Noise.stated(self.balance.stage) > 0.0:  # else replicates are read by a sensor that is guessed
            white = min(white, left * noise / max(float(model.errors.sum()), 1e-300))
        return float(np.sqrt(max(left - louder**2 * white, 0.0)))

    def numbers(self, model: Fitted, *, effects: bool) -> tuple[Floats, Floats, Floats]:
        """Return mass, damping, level and reach of friction, and sizes of believed `effects` by amount.

        Those of the model, (q,), without each block, (B_use, q), and the believed sizes with their signs.
        """
        b = self.balance
        sizes = ent.all_amounts(b.believed if effects else [])
        sign = np.where(sizes < 0.0, -1.0, 1.0)

        def of(c: Floats) -> Floats:
            elements = list(zip(c[b.friction], b.reaches, strict=True))
            own = sign * ent.all_amounts(self.believed_as(model, c) if effects else [])
            held = level_and_reach(elements, c[b.model] * b.models, b.exponent)
            return np.array([*c[: len(BASE)], *held, *own])

        return of(model.coefficients), np.array([of(c) for c in model.without]), sizes

    def believed_as(self, model: Fitted, c: Floats) -> list[Entry]:
        """Return the believed entries whose sizes are refitted, with those of coefficients `c` of a model."""
        return [
            ent.composed(e, c[span])
            for e, span in zip(self.balance.believed, model.system.of_entry, strict=False)
        ]

    def position(self, before: Stage, retuned: Stage, after: Stage, seed: int) -> PositionFit | None:
        """Return errors of position on the reserved part; None where forces judge."""
        return None

    def on(self, data: Data) -> Fitter:
        """Return the same objective on other data of equal length: a replicate."""
        other = Fitter(self.balance.on(data))
        other.offset = self.offset
        return other

    def solve(
        self, terms: Sequence[Term], weights: Floats, variance: float, around: Floats | None = None
    ) -> Solved:
        """Return `terms` as they are with their coefficients, for friction of `weights` (N/m) at hand."""
        return self._posed(terms, weights, around).solved(self.use, variance)

    def _posed(self, terms: Sequence[Term], weights: Floats, around: Floats | None = None) -> Posed:
        b = self.balance
        system = system_around(b, [t.entry for t in terms], weights, around)
        prior = prior_of(b, [*self._believed, *terms], system, offset=self.offset)
        grams = Grams.of(system.columns, system.y, b.block, b.blocks)
        return Posed(system, grams, as_held(b, prior) if terms else prior, b.block, not terms)

    def quick(self, terms: Sequence[Term]) -> float:
        """Return the squared error in sample of `terms` as they are, with believed friction at work."""
        weights = self.balance.weights
        for _ in range(2 if by_weights(self.balance, [t.entry for t in terms]) else 1):
            found = self.solve(terms, weights, 1.0)
            weights = found.c[self.balance.friction]
        return found.sse

    def fit(self, terms: Sequence[Term], start: Fitted | None = None, steps: int = STEPS) -> Fitted:
        """Fit a model from the values that its terms have; raise ConfigError where these are impossible."""
        b = self.balance
        current, weights = list(terms), b.weights
        alike = start is not None and start.weights.size == b.reaches.size
        if start is not None and alike and not newly_behind(terms, start.terms):
            weights = start.weights
        count = max(int(self.rows.sum()), 1)
        entries, made_for = [t.entry for t in current], weights
        # From the variance of noise upwards: one that another model leaves makes too much of the belief.
        posed = self._posed(current, made_for)
        at = posed.solved(self.use, 1.0)
        if by_weights(b, entries):
            made_for, current = at.c[b.friction], self._sized(current, at.system, at.c)
            posed = self._posed(current, made_for, at.c)
        at = posed.solved(self.use, at.sse / count)
        variance = at.sse / count
        weights = at.c[b.friction]
        free = free_of(current, b)
        damping, tangents = 1e-3, None
        for _ in range(steps if free else 0):
            tangents = tangents_of(b, current, free, at.system, at.c, weights)
            joint, wide = at.beside(tangents)
            power = np.diag(joint.gram[self.use].sum(axis=0))[at.c.size :]
            improved = False
            for _ in range(4):
                held = np.concatenate([wide.precision[: at.c.size], damping * power / max(variance, 1e-300)])
                whole = joint.solve(self.use, Prior(wide.mean, held, wide.low, wide.high), variance)
                if joint.errors(whole, self.use).sum() > (1.0 - SETTLED) * at.sse:
                    break  # no step is expected to gain anything
                trial = changed(self._sized(current, at.system, at.c), free, whole[at.c.size :])
                try:
                    found = self.solve(trial, weights, variance, at.c)
                except ConfigError:
                    damping *= 10.0
                    continue
                if found.sse < at.sse:
                    improved = True
                    break
                damping *= 10.0
            if not improved:
                break
            gained, tangents = 1.0 - found.sse / at.sse, None
            current, made_for, at = trial, weights, found
            weights, variance = at.c[b.friction], at.sse / count
            damping = max(0.1 * damping, 1e-6)
            free = free_of(current, b)
            if gained < SETTLED:
                break
        turns = TURNS if goes_by_whole(b, entries) else 0
        with suppress(ConfigError):  # where it grows beyond all bounds, it stays as it was
            while turns > 0 and not consistent(b, made_for, weights):
                at = self.solve(current, weights, variance, at.c)
                made_for, weights, turns, tangents = weights, at.c[b.friction], turns - 1, None
        if tangents is None:
            tangents = tangents_of(b, current, free, at.system, at.c, weights)
        done = self._finished(current, free, at, tangents, variance, weights)
        return self._as_it_is(done) if goes_by_whole(b, entries) else done

    def moved_by(self, model: Fitted, change: Floats) -> Fitted:
        """Return a model with coefficients and nonlinear parameters, (p + q,), others by `change`.

        Friction keeps its shape: its level changes. Raises ConfigError where no stage has such numbers.
        """
        c, own, reaches = model.coefficients, self.balance.friction, self.balance.reaches
        moved = np.clip(c + change[: c.size], model.prior.low, model.prior.high)
        level, more = (float(each[own] @ reaches) for each in (c, change))
        moved[own] = c[own] * (max(1.0 + more / level, 0.0) if level > 0.0 else 1.0)
        terms = self._sized(changed(model.terms, model.free, change[c.size :]), model.system, moved)
        rest = self.balance.error([t.entry for t in terms], moved, moved[own])
        return replace(model, terms=tuple(terms), coefficients=moved, residual=rest, weights=moved[own])

    def _as_it_is(self, model: Fitted) -> Fitted:
        """Return a model with the error of its own friction: its columns were made for one much like it."""
        true = self.balance.error(model.entries, model.coefficients, model.weights)
        worse = max(float(np.sum(true[self.rows] ** 2)) / max(model.sse, 1e-300), 1.0)
        return replace(model, residual=true, sse=worse * model.sse, errors=worse * model.errors)

    def jointly(self, model: Fitted, more: Floats) -> tuple[Grams, Prior]:
        """Return statistics and prior of the columns of a model and of `more`, (q, n), together."""
        return Posed(model.system, model.grams, model.prior, self.block, not model.terms).beside(more)

    def _finished(
        self,
        terms: list[Term],
        free: list[Free],
        at: Solved,
        tangents: Floats,
        variance: float,
        weights: Floats,
    ) -> Fitted:
        joint, wide = at.beside(tangents)
        whole = np.concatenate([at.c, np.zeros(len(free))])
        errors, without = left_out(joint, self.use, wide, variance, whole)
        return Fitted(
            tuple(self._sized(terms, at.system, at.c)), at.c, at.system, at.grams, at.prior, at.residual,
            tangents, tuple(free), errors, without, at.sse, variance, weights, self.balance.reaches,
        )  # fmt: skip

    def _sized(self, terms: Sequence[Term], system: System, c: Floats) -> list[Term]:
        """Return terms with the sizes that coefficients `c` of their system give them."""
        spans = system.of_entry[len(self._believed) :]
        return [
            term.with_entry(ent.composed(term.entry, c[span])) if span.stop > span.start else term
            for term, span in zip(terms, spans, strict=True)
        ]
