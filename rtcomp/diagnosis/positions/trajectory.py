"""The trajectory objective: position simulated over short windows, all numbers of the stage moved at once.

For axes that mostly stick finer than their sensor sees, where the force balance cannot judge. Numbers of the
belief are moved by their logarithm, friction by its level and its reach; residuals are errors of position of
which far ones count less. Blocks are left out on the problem linearised where the fit ended.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting import starting
from rtcomp.diagnosis.fitting.fit import STEPS, Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted, left_out
from rtcomp.diagnosis.fitting.free import Free, Term, all_free_of, changed, slopes
from rtcomp.diagnosis.fitting.other_forms import overtones
from rtcomp.diagnosis.fitting.stage_of import bank
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.reaches import elements_of
from rtcomp.diagnosis.forces.replicate import replicate
from rtcomp.diagnosis.numerics.regression import Grams, Prior, System
from rtcomp.diagnosis.positions.belief import LEVEL, Belief, is_sized
from rtcomp.diagnosis.positions.windows import GROUPS, Windows
from rtcomp.diagnosis.recordings.data import Data
from rtcomp.diagnosis.result import PositionFit
from rtcomp.diagnosis.settings import BELIEF_SD
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Effect
from rtcomp.stage.stage import Stage

STEP = 5e-3
"""With which derivatives along the numbers of the belief are taken."""
RELEASED = 0.3
"""Part of friction's level that a fit starts from too: the rest may have been what the effect makes."""
SETTLED = 3e-4
"""Relative gain of a step below which a fit ends."""
TRIES = 4
"""Dampings tried for one step."""


class Trajectory(Fitter):
    """Fits models to where the axis went."""

    by_force = False

    def __init__(self, balance: ForceBalance, stage: Stage, windows: Windows, scale: float) -> None:
        super().__init__(balance)
        volts = np.concatenate([s.voltage for s in balance.data.segments])
        force = stage.force_constant * float(np.sqrt(np.mean(volts**2)))
        self.belief, self.windows, self.scale = Belief(stage, force), windows, scale
        """The numbers that are moved; where a stage is let go; error (m) beyond which one counts less."""
        self._rows = windows.rows
        forced = windows.forced()[windows.block < GROUPS]
        self._power = float(np.sum((forced / scale) ** 2))

    @classmethod
    def of(cls, balance: ForceBalance, stage: Stage) -> Trajectory:
        """Take the usual error of `stage` as what is far."""
        windows = Windows.of(balance)
        off = np.abs(windows.off(stage)[windows.block < GROUPS])
        return cls(balance, stage, windows, max(float(np.median(off)), balance.noise.rms, 1e-300))

    # -- what an objective is -----------------------------------------------------------------------------

    @property
    def block(self) -> np.ndarray:
        """See `Fitter`."""
        return np.repeat(self.windows.block, self._rows)

    @property
    def blocks(self) -> int:
        """See `Fitter`: groups, and the reserved windows."""
        return GROUPS + 1

    @property
    def use(self) -> np.ndarray:
        """See `Fitter`."""
        return np.arange(GROUPS + 1) < GROUPS

    @property
    def power(self) -> float:
        """See `Fitter`: squared way that forces moved the axis within the windows."""
        return self._power

    def linear(self, kind: type[Effect]) -> bool:
        """See `Fitter`: nothing is linear here."""
        return False

    def rough(self, model: Fitted, families: Sequence[Sequence[Term]], count: int, ends: float) -> list[Term]:
        """See `Fitter`: first order is no guide to what sticks."""
        return starting.likeliest(self, model, families, count, ends)

    def change(self, model: Fitted, entry: Entry) -> Floats:
        """See `Fitter`."""
        other = self.residual(model.coefficients, [*model.terms, Term(entry, frozenset())])
        return model.residual - other

    def stage(self, model: Fitted, *, between: bool = False) -> Stage:
        """See `Fitter`."""
        return self._stage(model.coefficients, model.terms)

    def force(self, model: Fitted) -> Floats:
        """See `Fitter`."""
        return self._open(self.stage(model))

    def without(self, model: Fitted, at: int) -> Floats:
        """See `Fitter`."""
        return self._open(self._stage(model.coefficients, [*model.terms[:at], *model.terms[at + 1 :]]))

    def _open(self, stage: Stage) -> Floats:
        drive, needed = self.balance.both_sides(stage)
        return np.asarray(drive - needed)

    def other_forms(self, model: Fitted, besides: str) -> Floats:
        """See `Fitter`: of friction; what an effect's force does to the position is not in proportion."""
        return self.other_friction(model)

    def other_friction(self, model: Fitted) -> Floats:
        """See `Fitter`: each element of the believed friction stiffer by what a belief is off."""
        stage = self.stage(model)
        listed, exponent = elements_of(stage)

        def one(i: int) -> Floats:
            stiffer = (listed[i][0] * (1.0 + STEP), listed[i][1])
            changed = bank([*listed[:i], stiffer, *listed[i + 1 :]], exponent)
            other = stage.with_changes(stage={"friction": changed})
            return (model.residual - self._bent(self.windows.off(other))) * (BELIEF_SD / STEP)

        none = np.zeros((0, model.residual.size))
        made = self._forms.of(model, lambda: shared(one, range(len(listed))))
        return np.concatenate([none, np.reshape(made, (-1, model.residual.size))])

    def forms_of(self, model: Fitted, at: int) -> Floats:
        """Return no columns: see `other_forms`."""
        return np.zeros((0, model.residual.size))

    def variants(self, model: Fitted, at: int) -> Floats:
        """See `Fitter`: the overtones of a wave, to first order."""
        made = self._forms.of((model, at), lambda: [overtones(self, model, model.entries[at])])
        return np.asarray(made[0])

    def relative(self, model: Fitted, *, seen: bool = False, first: Floats | None = None) -> float:
        """See `Fitter`: error over the way that forces moved the axis; it counts by noise anyway."""
        return float(np.sqrt(np.sum(model.residual[self.rows] ** 2) / max(self._power, 1e-300)))

    def left_by(self, stage: Stage) -> Floats:
        """See `Fitter`."""
        count = max(int(np.count_nonzero(self.rows)), 1)
        return np.asarray(self._bent(self.windows.off(stage)) / np.sqrt(max(self._power / count, 1e-300)))

    def louder(self, model: Fitted) -> float:
        """See `Fitter`: no louder, so short a window tells no spectrum."""
        return 1.0

    def above_noise(self, model: Fitted, louder: float = 1.0, noise: float = math.inf) -> float:
        """See `Fitter`: a reading and that at the window's begin are both noisy."""
        read = 2.0 * (louder * self.balance.noise.rms / self.scale) ** 2 * np.count_nonzero(self.rows)
        return float(np.sqrt(max(self.relative(model) ** 2 - read / max(self._power, 1e-300), 0.0)))

    def has_offset(self, model: Fitted) -> bool:
        """See `Fitter`: none beside the entries."""
        return False

    def on(self, data: Data) -> Trajectory:
        """See `Fitter`."""
        balance = self.balance.on(data)
        return Trajectory(balance, self.belief.stage, self.windows.on(balance), self.scale)

    def believed_as(self, model: Fitted, c: Floats) -> list[Entry]:
        """See `Fitter`."""
        effects = self._stage(c[: len(self.belief.numbers)], []).mechanics.effects
        return [dict(e) for e in effects if is_sized(dict(e))]

    def position(self, before: Stage, retuned: Stage, after: Stage, seed: int) -> PositionFit | None:
        """See `Fitter`: mean absolute errors (m) over windows that lie in reserved blocks."""
        which = self.windows.block == GROUPS
        motion, noise = [p.x for p in self.balance.paths()], self.balance.noise.rms
        data = replicate(after, self.balance.data, motion, noise, seed)

        def error(windows: Windows, stage: Stage) -> float:
            return float(np.mean(np.abs(windows.off(stage)[which])))

        floor = error(self.on(data).windows, after) if data is not None else noise
        found = [error(self.windows, stage) for stage in (before, retuned, after)]
        return PositionFit(found[0], found[1], found[2], floor, self.windows.seconds)

    def quick(self, terms: Sequence[Term]) -> float:
        """See `Fitter`."""
        return float(np.sum(self.residual(np.zeros(len(self.belief.numbers)), terms)[self.rows] ** 2))

    def numbers(self, model: Fitted, *, effects: bool) -> tuple[Floats, Floats, Floats]:
        """See `Fitter`."""
        size = len(self.belief.numbers)
        amounts = ent.all_amounts(self.belief.own if effects else [])
        sets = [self.belief.values(c[:size], amounts) for c in model.without]
        return self.belief.values(model.coefficients, amounts), np.array(sets), amounts

    def _stage(self, c: Floats, terms: Sequence[Term]) -> Stage:
        return self.belief.moved(c, [t.entry for t in terms])

    # -- residuals and fits -------------------------------------------------------------------------------

    def _bent(self, off: Floats) -> Floats:
        """Return errors (m) over the scale, far ones bent: squares near, straight lines far; (n,)."""
        e = off.ravel() / self.scale
        return np.asarray(np.sign(e) * np.sqrt(2.0 * (np.sqrt(1.0 + e**2) - 1.0)))

    def residual(self, c: Floats, terms: Sequence[Term]) -> Floats:
        """Return the residual (n,) of numbers `c` (p,) and `terms`; raise ConfigError where out of range."""
        return self._bent(self.windows.off(self._stage(c, terms)))

    def fit(self, terms: Sequence[Term], start: Fitted | None = None, steps: int = STEPS) -> Fitted:
        """See `Fitter`; from where `start` ended, and with friction released."""
        c = np.zeros(len(self.belief.numbers)) if start is None else start.coefficients
        begun = [c]
        if steps and start is not None and terms:
            released = c.copy()
            levels = [i for i, n in enumerate(self.belief.numbers) if n.name == LEVEL]
            released[levels] += math.log(RELEASED)
            begun += [released] if levels else []
        few = starting.FEW if len(begun) > 1 else 0
        near = None if start is None else start.system.columns
        tried = [self.moved(one, list(terms), few, entries=True, slopes=near) for one in begun]
        c, found, _ = min(tried, key=lambda t: t[2])
        c, found, _ = self.moved(c, found, max(steps, starting.FEW), entries=steps > 0, slopes=near)
        return self._ended(c, found)

    def as_believed(self) -> Fitted:
        """Return the belief as it is, none of its numbers moved."""
        return self._ended(np.zeros(len(self.belief.numbers)), [])

    def left_as_believed(self) -> Floats:
        """Return the squared error of the belief as it is in each block to fit, (B,)."""
        rest = self.residual(np.zeros(len(self.belief.numbers)), [])
        return np.asarray(np.bincount(self.block, rest**2, self.blocks)[self.use])

    def moved(
        self, c: Floats, terms: list[Term], steps: int, *, entries: bool, slopes: Floats | None = None
    ) -> tuple[Floats, list[Term], float]:
        """Return numbers and terms after Levenberg-Marquardt steps, and what they leave with the prior.

        `slopes` (p, n) along the numbers may be those of a model nearby. From step to step they are corrected
        by what the step did (Broyden 1965, Math. Comp. 19(92)), computed again where it gains nothing.
        """
        prior, use = self.belief.prior, self.use
        rest = self.residual(c, terms)
        count = int(self.rows.sum())

        def left(c: Floats, rest: Floats, variance: float) -> float:
            return float(np.sum(rest[self.rows] ** 2) + variance * np.sum(prior.precision * c**2))

        variance = float(np.sum(rest[self.rows] ** 2)) / count
        damping = 1e-2
        for _ in range(steps):
            free = all_free_of(terms, self.balance) if entries else []
            known = slopes is not None
            own = slopes if slopes is not None else self._slopes(c, terms, rest)
            columns = np.concatenate([own, self._slopes_of(c, terms, free, rest)])
            y = rest + c @ own
            grams = Grams.of(columns, y, self.block, self.blocks)
            power = np.diag(grams.gram[use].sum(axis=0)) / max(variance, 1e-300)
            before, better = left(c, rest, variance), False
            for _ in range(TRIES):
                held = damping * power
                precision = np.concatenate([prior.precision, np.zeros(len(free))]) + held
                mean = held * np.concatenate([c, np.zeros(len(free))]) / np.maximum(precision, 1e-300)
                wide = np.full(len(free), np.inf)
                bounds = np.concatenate([prior.low, -wide]), np.concatenate([prior.high, wide])
                moved = grams.solve(use, Prior(mean, precision, *bounds), variance)
                other = c + np.clip(moved[: c.size] - c, -0.5, 0.5)
                trial = changed(terms, free, moved[c.size :])
                try:
                    after = self.residual(other, trial)
                except ConfigError:
                    damping *= 10.0
                    continue
                if left(other, after, variance) < before:
                    better = True
                    break
                damping *= 8.0
            if better:
                gone = np.concatenate([other - c, [f.get(trial) - f.get(terms) for f in free]])
                off = rest - after - gone @ columns
                slopes = own + np.outer(gone[: c.size], off) / max(float(gone @ gone), 1e-300)
                c, terms, rest = other, trial, after
                damping = max(0.2 * damping, 1e-5)
            if not better or left(c, rest, variance) > (1.0 - SETTLED) * before:
                if not known:
                    break
                slopes, damping = None, 1e-2
            variance = float(np.sum(rest[self.rows] ** 2)) / count
        return c, terms, left(c, rest, variance)

    def moved_by(self, model: Fitted, change: Floats) -> Fitted:
        """See `Fitter`."""
        c, size = model.coefficients, model.coefficients.size
        moved = np.clip(c + change[:size], model.prior.low, model.prior.high)
        terms = changed(model.terms, model.free, change[size:])
        rest = self.residual(moved, terms)
        return replace(model, terms=tuple(terms), coefficients=moved, residual=rest)

    def _slopes(self, c: Floats, terms: list[Term], rest: Floats) -> Floats:
        """Return what the model changes by with each number, (p, n)."""

        def one(i: int) -> Floats:
            for way in (STEP, -STEP):
                other = c.copy()
                other[i] += way
                try:
                    return (rest - self.residual(other, terms)) / way
                except ConfigError:
                    continue
            return np.zeros_like(rest)

        return np.array(shared(one, range(c.size)))

    def _slopes_of(self, c: Floats, terms: list[Term], free: Sequence[Free], rest: Floats) -> Floats:
        """Return what the model changes by with each free parameter, (q, n)."""
        return slopes(terms, free, lambda trial: rest - self.residual(c, trial), rest.size)

    def _ended(self, c: Floats, terms: list[Term]) -> Fitted:
        rest = self.residual(c, terms)
        free = all_free_of(terms, self.balance)
        own, tangents = self._slopes(c, terms, rest), self._slopes_of(c, terms, free, rest)
        y = rest + c @ own
        nowhere = slice(c.size, c.size)
        system = System(y, own, (nowhere,) * (len(self.balance.believed) + len(terms)))
        prior = self.belief.prior
        grams = Grams.of(own, y, self.block, self.blocks)
        joint, wide = grams.extended(own, tangents, y, self.block), prior.extended(tangents.shape[0])
        sse = float(np.sum(rest[self.rows] ** 2))
        variance = sse / max(int(self.rows.sum()), 1)
        whole = np.concatenate([c, np.zeros(len(free))])
        errors, without = left_out(joint, self.use, wide, variance, whole)
        return Fitted(
            tuple(terms), c, system, grams, prior, rest, tangents, tuple(free), errors, without, sse,
            variance, np.zeros(0), np.zeros(0),
        )  # fmt: skip
