"""What a fit moves: the terms of a model, and their nonlinear parameters on the scales they are moved on."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.cores import shared
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Parameter

LONGEST = 1.25
"""Longest period of a wave, relative to the stroke."""
SMALL = 0.05
"""Size of a parameter, over that of the drive's force or of 1, that is taken to be first order."""
SWINGS = 2.0
"""Times the motion's bandwidth up to which a resonance may lie: at half of it, it swings a third more."""
FASTEST = 2.0
"""Times the fastest motion up to which a speed may lie: what changes beyond is a constant in this motion."""
AT_BOUND = 1e-3
"""Part of a number, or of a short range, by which it may be away from its bound and still be at it."""


@dataclass(frozen=True)
class Term:
    """An entry in a model, and the names of its parameters that a fit moves."""

    entry: Entry
    free: frozenset[str]

    @classmethod
    def of(cls, entry: Entry) -> Term:
        """Take all parameters that the entry states to be free."""
        own = [*ent.free_parameters(entry, linear=True), *ent.free_parameters(entry, linear=False)]
        return cls(entry, frozenset(p.name for p in own))

    def with_entry(self, entry: Entry) -> Term:
        """Return the term with other values."""
        return Term(entry, self.free)


@dataclass(frozen=True)
class Free:
    """A nonlinear parameter: the term and its name, how it is scaled, and its derivative's step."""

    term: int
    name: str
    low: float
    high: float
    log: bool
    step: float
    told: bool = True
    """Whether being as large as it may be is a finding: not so where the recording could not show more."""

    def get(self, terms: Sequence[Term]) -> float:
        """Return its value on the scale it is moved on."""
        value = float(terms[self.term].entry[self.name])
        return math.log(value) if self.log else value

    def most(self, terms: Sequence[Term]) -> float:
        """Return the furthest that one step of a fit may move it."""
        return 0.7 if self.log else max(0.5 * abs(self.get(terms)), 20.0 * self.step)

    def at_bound(self, terms: Sequence[Term]) -> bool:
        """Tell whether it is as large or as small as it may be."""
        value = float(terms[self.term].entry[self.name])
        near = AT_BOUND * abs(value)
        return (self.told and value >= self.high - near) or 0.0 < self.low >= value - near

    def put(self, terms: list[Term], value: float) -> None:
        """Give it a value on that scale, within its bounds."""
        plain = math.exp(value) if self.log else value
        entry = {**terms[self.term].entry, self.name: min(max(plain, self.low), self.high)}
        terms[self.term] = terms[self.term].with_entry(entry)


def free_of(terms: Sequence[Term], balance: ForceBalance) -> list[Free]:
    """Return the nonlinear parameters of `terms` that a fit moves, within what the recording could show."""
    return _free_of(terms, balance, sizes=False)


def all_free_of(terms: Sequence[Term], balance: ForceBalance) -> list[Free]:
    """Return all parameters of `terms` that a fit moves where none is linear."""
    return _free_of(terms, balance, sizes=True)


def _free_of(terms: Sequence[Term], balance: ForceBalance, *, sizes: bool) -> list[Free]:
    low, high = balance.data.stroke
    found = []
    for i, term in enumerate(terms):
        kind = ent.kind_of(term.entry)
        waves = any(p.unit == ent.PHASE and p.name in term.entry for p in kind.parameters)
        own = ent.free_parameters(term.entry, linear=True) if sizes else []
        for p in [*own, *ent.free_parameters(term.entry, linear=False)]:
            if p.name not in term.free:
                continue
            value, least, most = float(term.entry[p.name]), p.lowest, ent.highest(term.entry, p)
            log = p.lowest >= 0.0 and value > 0.0
            step = 0.02 if log else max(0.02 * abs(value), 1e-9 * (high - low if p.unit == "m" else 1.0))
            if p in own:
                step = max(step, 0.2 * first_order(p, balance))
            elif p.unit == ent.PHASE:
                step = 0.05
            elif p.name == ent.PERIOD:
                # A wave longer than the stroke is a slope by another name.
                step, most = min(0.02, 0.02 * value / (high - low)), min(p.high, LONGEST * (high - low))
            elif p.unit == "Hz":
                # What swings beyond the motion's bandwidth shows where motion makes it swing more than one
                # that is held; a stiff contact is as good as a rigid one, and needs not be shown.
                shown = min(SWINGS * balance.noise.bandwidth, 0.5 * balance.data.rate)
                most = min(p.high, shown if p.default is None else balance.data.rate)
                step = min(0.02, 0.01 / (value * balance.data.last)) if waves else step
            elif p.unit == "m/s" and p.name not in kind.linear:
                most = min(most, FASTEST * _fastest(balance))
            elif p.unit == "s" and p.name not in (kind.neutral or {}):
                # A scale shorter than a row is no finding; a size may be as small as it is.
                least = max(p.lowest, min(balance.data.period, value))
            elif p.unit == "m" and p.lowest < 0.0 and p.name not in kind.linear:
                step = 0.002 * (high - low)
            told = p.unit != "Hz" or p.default is None
            found.append(Free(i, p.name, least, most, log, step, told))
    return found


def _fastest(balance: ForceBalance) -> float:
    """Return the largest speed (m/s) of the recorded motion."""
    return max(float(np.abs(path.v).max()) for path in balance.paths())


def changed(terms: Sequence[Term], free: Sequence[Free], change: Floats) -> list[Term]:
    """Return terms with their free parameters others by `change`, (q,), as far as one step may go."""
    moved = list(terms)
    for f, step in zip(free, change.tolist(), strict=True):
        f.put(moved, f.get(terms) + min(max(step, -f.most(terms)), f.most(terms)))
    return moved


def slopes(
    terms: list[Term], free: Sequence[Free], changed: Callable[[list[Term]], Floats], rows: int
) -> Floats:
    """Return what a model changes by with each free parameter, (q, rows); `changed` tells it for any terms.

    0 for a parameter that cannot be moved.
    """

    def one(f: Free) -> Floats:
        for way in (f.step, -f.step):
            trial = list(terms)
            f.put(trial, f.get(terms) + way)
            moved = f.get(trial) - f.get(terms)
            if moved == 0.0:
                continue
            try:
                return changed(trial) / moved
            except ConfigError:
                continue
        return np.zeros(rows)

    return np.array(shared(one, free)) if free else np.zeros((0, rows))


def first_order(p: Parameter, balance: ForceBalance) -> float:
    """Return a size of a linear parameter that is first order and above rounding, by its unit."""
    data = balance.data
    volts = float(np.sqrt(np.mean(np.concatenate([s.voltage for s in data.segments]) ** 2)))
    low, high = data.stroke
    stroke = max(high - low, 1e-12)
    force = balance.stage.force_constant * volts
    scale = {
        "m": max(3.0 * balance.noise.rms, 1e-4 * (high - low)),
        "s": data.period,
        "V": SMALL * volts,
        "1/m": SMALL / stroke,
        "N": SMALL * force,
        "N s/m": SMALL * force / stroke,
        "N/m": SMALL * force / (0.5 * stroke),
        "N/m^3": SMALL * force / (0.5 * stroke) ** 3,
    }
    return min(scale.get(p.unit, SMALL), 0.5 * p.high)
