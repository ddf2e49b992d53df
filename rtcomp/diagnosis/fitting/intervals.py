"""Intervals of what a fit found, by leaving blocks out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import ONCE, Fitted, left_out
from rtcomp.diagnosis.fitting.free import AT_BOUND
from rtcomp.diagnosis.fitting.retuned import MOVED, Numbers, believed_friction
from rtcomp.diagnosis.forces.balance import BASE
from rtcomp.diagnosis.numerics.spread import BALANCE, MODEL, elsewhere, scatter
from rtcomp.diagnosis.result import Retuned, Value
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis


@dataclass(frozen=True)
class Told:
    """An entry's numbers with their intervals, and what of them makes it no finding."""

    values: dict[str, Value]
    nothing: bool
    """Every size of it may be neutral."""
    bound: tuple[str, ...]
    """Parameters at a bound: a physical one, or what the recording could show at most."""


def told(fitter: Fitter, fitted: Fitted) -> list[Told]:
    """Return the 95 % intervals of each term's parameters.

    Blocks of the recording are left out in turn (delete-a-group jackknife: Bell and McCaffrey 2002, Survey
    Methodology 28(2)); what a single block tells is compared with the rest of the recording. What replicates
    are off by was taken off, and is known to no more than its own size.
    """
    from scipy.special import stdtrit

    balance = fitter.balance
    spans = fitted.system.of_entry[len(balance.believed) :]
    factor = float(stdtrit(max(fitted.without.shape[0] - 1, 1), 0.975))
    axis = balance.stage.axis
    found = []
    held = _shapes_held(fitter, fitted)
    for i, (term, span) in enumerate(zip(fitted.terms, spans, strict=True)):
        kind = ent.kind_of(term.entry)
        without, once = _values(fitted, i, span, fitted.without), _once(fitter, fitted, i, span)
        alone, off = _values(held, i, span, held.without), _off(fitted, i, span)
        values, neutral = {}, []
        bound = [f.name for f in fitted.free if f.term == i and f.at_bound(fitted.terms)]
        for p in kind.parameters:
            if p.name not in term.entry:
                continue
            value = float(term.entry[p.name])
            half = 0.0
            if p.name in without:
                apart = without[p.name] - value
                if p.unit == ent.PHASE:
                    apart = (apart + np.pi) % (2.0 * np.pi) - np.pi
                sd = _deviation(apart)
                size = 2.0 if p.unit == ent.PHASE else abs(value)
                spread = factor * max(sd, once.get(p.name, 0.0))
                half = math.hypot(spread, off.get(p.name, 0.0), MODEL * size)
                if p.name not in bound and _at_bound(value, p.lowest, ent.highest(term.entry, p)):
                    bound.append(p.name)
            elif p.name == ent.MOMENT:
                half = balance.data.period
            low, high = max(value - half, p.low), min(value + half, ent.highest(term.entry, p))
            values[p.name] = Value(value, low, high, for_axis(p.unit, axis))
            if p.name in kind.linear and p.name in without:
                spread = max(_deviation(alone[p.name] - value), once.get(p.name, 0.0))
                half = math.hypot(factor * spread, MODEL * abs(value))
                neutral.append(abs(value - ent.neutral(kind, p.name)) <= half)
        found.append(Told(values, bool(neutral) and all(neutral), tuple(bound)))
    return found


def _deviation(without: Floats) -> float:
    """Return the standard deviation of a number found without each block in turn, (B,)."""
    return float(np.sqrt(max(scatter(without[:, None])[0, 0], 0.0)))


def _shapes_held(fitter: Fitter, fitted: Fitted) -> Fitted:
    """Return the fit with only the sizes of its effects free: what is nothing has no shape."""
    sizes = [k for k, f in enumerate(fitted.free) if f.name in ent.kind_of(fitted.entries[f.term]).linear]
    free = tuple(fitted.free[k] for k in sizes)
    return _left_out(fitter, replace(fitted, tangents=fitted.tangents[sizes], free=free))


def _left_out(fitter: Fitter, fitted: Fitted, numbers: int = 0) -> Fitted:
    """Return the fit with its coefficients `without` each block computed again."""
    grams, wide = fitter.jointly(fitted, fitted.tangents)
    found = left_out(grams, fitter.use, wide, fitted.variance, fitted.whole, numbers)
    return replace(fitted, without=found[1])


def _at_bound(value: float, low: float, high: float) -> bool:
    near = AT_BOUND * (high - low) if high - low <= 10.0 else AT_BOUND * abs(value)
    return value >= high - near or (low > 0.0 and value <= low + near)


def _off(fitted: Fitted, at: int, span: slice) -> dict[str, float]:
    """Return by how much each free parameter of a term is off in replicates, on average."""
    if fitted.off is None:
        return {}
    found = _values(fitted, at, span, np.array([fitted.whole, fitted.whole + fitted.off]))
    return {name: float(abs(values[1] - values[0])) for name, values in found.items()}


def _values(fitted: Fitted, at: int, span: slice, sets: Floats) -> dict[str, Floats]:
    """Return the values (S,) of each free parameter of a term by `sets` of coefficients, (S, p + q)."""
    term = fitted.terms[at]
    size = fitted.coefficients.size
    found: dict[str, Floats] = {}
    if span.stop > span.start:
        made = [ent.composed(term.entry, c[span]) for c in sets]
        moved = [n for n in made[0] if n in term.free and isinstance(made[0][n], float)]
        found.update({n: np.array([m[n] for m in made]) for n in moved})
    for k, free in enumerate(fitted.free):
        if free.term != at:
            continue
        values = free.get(fitted.terms) + sets[:, size + k]
        plain = np.exp(np.minimum(values, 700.0)) if free.log else values
        found[free.name] = np.clip(plain, free.low, free.high)
    return found


def _once(fitter: Fitter, fitted: Fitted, at: int, span: slice) -> dict[str, float]:
    """Return standard deviations of numbers that one block alone tells."""
    use = fitter.rows
    block, rest = fitter.block[use], fitted.residual[use]
    found: dict[str, float] = {}

    def alone(column: Floats) -> bool:
        power = np.bincount(block, column**2, fitter.blocks)
        return bool(power.max() > ONCE * max(float(power.sum()), 1e-300))

    own = [n for n in ent.kind_of(fitted.terms[at].entry).linear if n in fitted.terms[at].entry]
    for name, column in zip(own, fitted.system.columns[span], strict=False):
        if alone(column[use]):
            found[name] = math.sqrt(elsewhere(column[use], rest))
    for free, tangent in zip(fitted.free, fitted.tangents, strict=True):
        if free.term == at and alone(tangent[use]):
            sd = math.sqrt(elsewhere(tangent[use], rest))
            found[free.name] = sd * (float(fitted.terms[at].entry[free.name]) if free.log else 1.0)
    return found


def believed_sizes(fitter: Fitter, fitted: Fitted) -> list[Retuned]:
    """Return the sizes of believed effects that moved, each by more than its 95 % interval."""
    from scipy.special import stdtrit

    axis = fitter.balance.stage.axis
    factor = float(stdtrit(max(fitted.without.shape[0] - 1, 1), 0.975))
    now = fitter.believed_as(fitted, fitted.coefficients)
    others = [fitter.believed_as(fitted, c) for c in fitted.without]
    found = []
    for i, (was, entry) in enumerate(zip(fitter.balance.believed, now, strict=False)):
        kind = ent.kind_of(was)
        for p in (ent.parameter(kind, n) for n in kind.linear if n in was):
            before, value = float(was[p.name]), float(entry[p.name])
            sd = _deviation(np.array([float(one[i][p.name]) for one in others]))
            half = math.hypot(factor * sd, MODEL * abs(value))
            if before != 0.0 and abs(value - before) > max(half, MOVED * abs(before)):
                told = Value(value, value - half, value + half, for_axis(p.unit, axis))
                found.append(Retuned(f"{kind.name}.{p.name}", before, told))
    return found


def numbers(fitter: Fitter, believed: Stage, fitted: Fitted, *, effects: bool = False) -> Numbers:
    """Return mass, damping, level and reach of friction, believed and found, with their half widths.

    With `effects`, the sizes of forces that believed effects add as well, by amount.
    """
    from scipy.special import stdtrit

    # Where a fast run is in one block only, the others still tell mass and damping, though less well.
    values, sets, sizes = fitter.numbers(_left_out(fitter, fitted, len(BASE)), effects=effects)
    spread = np.maximum(np.diag(scatter(sets)), 0.0)
    factor = float(stdtrit(max(sets.shape[0] - 1, 1), 0.975))
    off = _numbers_off(fitter, fitted, values, effects=effects)
    half = np.sqrt(factor**2 * spread + (MODEL * values) ** 2 + off**2)
    m = believed.mechanics
    before = np.array([m.mass, m.viscous, m.micro_damping, *believed_friction(believed), *np.abs(sizes)])
    sized = fitter.believed_as(fitted, fitted.coefficients) if effects else []
    own = [(ent.kind_of(e), n) for e in sized for n in ent.amounts_of(e)]
    units = Numbers.units + tuple(ent.parameter(kind, name).unit for kind, name in own)
    return Numbers(before, values, half, units)


def _numbers_off(fitter: Fitter, fitted: Fitted, values: Floats, *, effects: bool) -> Floats:
    """Return by how much numbers of the stage, (q,), are off in replicates.

    Where there are none, how much each could be another for a part of the force; nothing of a reach.
    """
    if fitted.off is not None:
        moved = replace(fitted, without=(fitted.whole + fitted.off)[None])
        return np.asarray(fitter.numbers(moved, effects=effects)[1][0] - values)
    found = np.zeros(values.size)
    if not fitter.by_force:
        return found
    columns, rows, level = fitted.system.columns, fitter.rows, len(BASE)
    friction = fitted.coefficients[fitter.balance.friction] @ columns[fitter.balance.friction]
    of_one = [*columns[: len(BASE)], friction / max(float(values[level]), 1e-300)]
    for i, column in enumerate(of_one):
        power = float(np.mean(column[rows] ** 2))
        if power > 0.0 and values[i] > 0.0:
            found[i] = BALANCE * math.sqrt(float(np.mean(fitted.system.y[rows] ** 2)) / power)
    return found
