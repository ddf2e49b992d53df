"""Screening: the gain of every candidate on blocks left out, to first order, base refitted with each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.effects import Candidate, candidates
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import ONCE, Fitted
from rtcomp.diagnosis.fitting.other_forms import any_laws
from rtcomp.diagnosis.numerics.regression import RIDGE
from rtcomp.diagnosis.numerics.significance import Null
from rtcomp.kernels import Floats


@dataclass(frozen=True)
class Screened:
    """What a candidate does to the squared error of blocks left out, to first order, and its sizes."""

    gain: float
    """Mean over the blocks of log(squared error without / with it)."""
    sizes: Floats
    """(q,) of its columns."""
    left: float
    """Squared error with it, of all blocks: of an entry that is tried as it is, not with a part of it."""


class Screen:
    """Candidates' columns against one fitted model's, ready for any number of residuals.

    A candidate has up to Q columns; those with fewer are filled up with a column of nothing.
    """

    def __init__(self, found: Sequence[Candidate], fitter: Fitter, variants: Floats | None = None) -> None:
        self.candidates = list(found)
        self.variants = np.zeros((0, fitter.block.size)) if variants is None else variants
        """Columns (q, n) that stand beside any model as well."""
        if not found:
            return
        self._use = np.flatnonzero(fitter.use).tolist()
        self._edges = list(pairwise(np.searchsorted(fitter.block, np.arange(fitter.blocks + 1)).tolist()))
        self._columns = np.concatenate([*(c.columns for c in found), np.zeros((1, fitter.block.size))])
        norm = np.sqrt(np.einsum("ij,ij->i", self._columns, self._columns))
        scale = np.where(norm > 0.0, norm, 1.0)
        self._columns /= scale[:, None]
        self._sizes = [c.columns.shape[0] for c in found]
        starts = np.cumsum([0, *self._sizes[:-1]])
        nothing, most = scale.size - 1, max(self._sizes)
        self._index = np.full((len(found), most), nothing)
        for row, start, size in zip(self._index, starts.tolist(), self._sizes, strict=True):
            row[:size] = np.arange(start, start + size)
        self._scale = scale[self._index]
        self._low = np.append(np.concatenate([c.low for c in found]), 0.0)[self._index] * self._scale
        self._high = np.append(np.concatenate([c.high for c in found]), 0.0)[self._index] * self._scale
        self._filled = np.eye(most) * (self._index == nothing)[:, None, :]
        self._as_it_is = np.array([c.parts == (c.term.entry,) for c in found])[:, None]
        self._own = [self._products(k) for k in self._use]
        power = np.array([np.einsum("cqq->cq", own) for own in self._own])
        self._once = np.any(power > ONCE * np.maximum(power.sum(axis=0), 1e-300), axis=2)

    def _products(self, block: int) -> Floats:
        """Return the products (C, Q, Q) of each candidate's columns on a block."""
        a, b = self._edges[block]
        part = self._columns[:, a:b]
        most = self._index.shape[1]
        found = np.empty((self._index.shape[0], most, most))
        for i in range(most):
            for j in range(i + 1):
                if i == j:
                    power = np.einsum("ij,ij->i", part, part)
                    found[:, i, i] = power[self._index[:, i]]
                    continue
                some = np.flatnonzero(self._index[:, i] < part.shape[0] - 1)
                product = np.zeros(self._index.shape[0])
                product[some] = np.einsum("ij,ij->i", part[self._index[some, i]], part[self._index[some, j]])
                found[:, i, j] = found[:, j, i] = product
        return found

    def beside(self, model: Fitted) -> list[Screened]:
        """Return the gain of every candidate beside a fitted model."""
        return self.gains(self.columns_beside(model), model.residual)

    def columns_beside(self, model: Fitted) -> Floats:
        """Return the columns (p, n) beside which candidates of a fitted model are looked at."""
        return np.concatenate([model.free_columns, self.variants])

    def gains(self, model: Floats, residual: Floats) -> list[Screened]:
        """Return the gain of every candidate beside the columns `model` (p, n) that left `residual` (n,).

        The columns are those that are free in the fit: not at a bound.
        """
        if not self.candidates:
            return []
        parts, whole, own = self._parts(model, residual)
        sizes, _, _ = self._sized(whole, own)
        before, after = np.empty(len(parts)), np.empty((len(self.candidates), len(parts)))
        begun = np.zeros(len(self.candidates))
        for j, part in enumerate(parts):
            d, base, solved = self._sized(whole.without(part), own - self._own[j])
            d = np.where(self._once[j][:, None], sizes, d)
            before[j] = part.rr - 2.0 * base @ part.ar + base @ part.aa @ base
            # Squared error of base - solved d and d on this block, for all candidates together.
            turned = part.aa @ solved - part.ad
            slope = part.dr - base @ part.ad - (part.ar - part.aa @ base) @ solved
            curved = np.einsum("pcq,pcr->cqr", solved[:, self._index], turned[:, self._index])
            curved -= np.einsum("pcq,pcr->cqr", part.ad[:, self._index], solved[:, self._index])
            curved += self._own[j]
            lines = slope[self._index]
            after[:, j] = before[j] + _parabola(lines, curved, d)
            begun += before[j] + _parabola(lines, curved, np.where(self._as_it_is, self._scale, d))
        floor = 1e-9 * np.array([p.rr for p in parts]) + 1e-300
        gain = np.mean(np.log(np.maximum(before, floor) / np.maximum(after, floor)), axis=1)
        return [
            Screened(float(g), d[:n] / s[:n], float(left))
            for g, d, s, n, left in zip(gain, sizes, self._scale, self._sizes, begun, strict=True)
        ]

    def explained(self, model: Fitted) -> Floats:
        """Return the squared residual (C,) that each candidate takes away beside a model, in sample."""
        _, whole, own = self._parts(self.columns_beside(model), model.residual)
        sizes, base, solved = self._sized(whole, own)
        inner = own - np.einsum("pcq,pcr->cqr", whole.ad[:, self._index], solved[:, self._index])
        target = (whole.dr - base @ whole.ad)[self._index]
        curved = np.einsum("cq,cqr,cr->c", sizes, inner, sizes)
        return np.asarray(2.0 * np.einsum("cq,cq->c", sizes, target) - curved)

    def _parts(self, model: Floats, residual: Floats) -> tuple[list[_Part], _Part, Floats]:
        """Return products with columns `model` (p, n), scaled, by block and in all, and candidates' own."""
        norm = np.sqrt(np.einsum("ij,ij->i", model, model))
        model = model / np.where(norm > 0.0, norm, 1.0)[:, None]
        parts = [_Part.of(model[:, a:b], self._columns[:, a:b], residual[a:b]) for a, b in
                 (self._edges[k] for k in self._use)]  # fmt: skip
        whole = _Part(*(sum(getattr(p, n) for p in parts) for n in _Part.__annotations__))
        return parts, whole, np.asarray(sum(self._own, np.zeros_like(self._own[0])))

    def _sized(self, part: _Part, own: Floats) -> tuple[Floats, Floats, Floats]:
        """Return sizes (C, Q) of candidates fitted with the model, its sizes alone, candidates through it."""
        a = part.aa + RIDGE * np.eye(part.aa.shape[0])
        solution = np.linalg.solve(a, np.column_stack([part.ad, part.ar]))
        solved, base = solution[:, :-1], solution[:, -1]
        inner = own - np.einsum("pcq,pcr->cqr", part.ad[:, self._index], solved[:, self._index])
        size = inner.shape[1]
        ridge = 1e-9 * np.einsum("cqq->c", own) / size + 1e-300
        inner = inner + ridge[:, None, None] * np.eye(size) + self._filled
        target = (part.dr - base @ part.ad)[self._index]
        sizes = np.linalg.solve(inner, target[:, :, None])[:, :, 0]
        return np.clip(sizes, self._low, self._high), np.asarray(base), np.asarray(solved)


def _parabola(slope: Floats, curved: Floats, sizes: Floats) -> Floats:
    """Return how much more sizes (C, Q) of columns leave, (C,), by slopes (C, Q) and products (C, Q, Q)."""
    return np.asarray(np.einsum("cq,cqr,cr->c", sizes, curved, sizes) - 2.0 * np.sum(sizes * slope, axis=1))


@dataclass(frozen=True)
class _Part:
    """Products of the model's columns a, the candidates' d and the residual r on some rows."""

    aa: Floats
    ad: Floats
    ar: Floats
    dr: Floats
    rr: Floats

    @classmethod
    def of(cls, a: Floats, d: Floats, r: Floats) -> _Part:
        return cls(a @ a.T, a @ d.T, a @ r, d @ r, np.asarray(r @ r))

    def without(self, other: _Part) -> _Part:
        """Return the products on the other rows."""
        return _Part(
            self.aa - other.aa, self.ad - other.ad, self.ar - other.ar, self.dr - other.dr, self.rr - other.rr
        )


@dataclass(frozen=True)
class Look:
    """All candidates beside a model, their gains, the null distribution where it was asked for."""

    candidates: list[Candidate]
    screened: list[Screened]
    screen: Screen
    null: Null | None = None
    cut: bool = False
    """Whether there was no time for all candidates."""

    @property
    def gain(self) -> float:
        """The largest gain, 0 where no candidate was looked at."""
        return max((s.gain for s in self.screened), default=0.0)

    def beside(self, other: Fitted, only: str | None = None) -> tuple[list[Candidate], list[Screened]]:
        """Return the candidates that another model does not have, and their gains beside that.

        What an effect changes is much the same beside either; where it begins to be fitted is all that is
        needed. `only` names the effect that is asked for, if it is one.
        """
        own = ent.names(other.entries)
        pairs = zip(self.candidates, self.screen.beside(other), strict=True)
        found = [pair for pair in pairs if pair[0].name not in own and only in (None, pair[0].name)]
        return [candidate for candidate, _ in found], [gain for _, gain in found]


def look(
    fitter: Fitter,
    model: Fitted,
    ends: float = math.inf,
    known: Sequence[Candidate] | None = None,
    without: Sequence[str] = (),
) -> Look:
    """Look at all candidates beside a model, or those made in time, without their null distribution.

    But for those of the effects `without`; what is `known` is not made again. Of the model's own effects any
    form of their law stands beside them: what only makes up for the form is no candidate.
    """
    beside = any_laws(fitter, model)

    def explained(some: Sequence[Candidate]) -> Floats:
        return Screen(some, fitter, beside).explained(model)

    taken = [*ent.names(model.entries), *without]
    made = candidates(fitter, model, taken, ends=ends, known=known or (), explained=explained)
    cut = clock.now() > ends
    screen = Screen(made, fitter, beside)
    return Look(made, screen.beside(model), screen, None, cut)
