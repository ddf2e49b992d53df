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
from rtcomp.physics import Parameter
from rtcomp.stage.stage import Stage
from rtcomp.units import for_axis

AROUND = 360
"""Points along the edge of what two sizes may be."""


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
    balance = fitter.balance
    spans = fitted.system.of_entry[len(balance.believed) :]
    axis = balance.stage.axis
    found = []
    held, factor = _shapes_held(fitter, fitted), _factor(fitted.without)
    for i, (term, span) in enumerate(zip(fitted.terms, spans, strict=True)):
        kind = ent.kind_of(term.entry)
        without, once = _values(fitted, i, span, fitted.without), _once(fitter, fitted, i, span)
        off, around = _off(fitted, i, span), _around(fitted, i, span)
        values = {}
        bound = [f.name for f in fitted.free if f.term == i and f.at_bound(fitted.terms)]
        for p in kind.parameters:
            if p.name not in term.entry:
                continue
            value = float(term.entry[p.name])
            down = up = 0.0
            if p.name in without:
                size = 2.0 if p.unit == ent.PHASE else abs(value)
                spread = factor * _deviation(_apart(p, without[p.name], value))
                least, more = factor * once.get(p.name, 0.0), math.hypot(off.get(p.name, 0.0), MODEL * size)
                ends = around.get(p.name, (spread, spread))
                down, up = (math.hypot(max(end, least), more) for end in ends)
                if p.name not in bound and _at_bound(value, p.lowest, ent.highest(term.entry, p)):
                    bound.append(p.name)
            elif p.name == ent.MOMENT:
                down = up = balance.data.period
            low, high = max(value - down, p.low), min(value + up, ent.highest(term.entry, p))
            values[p.name] = Value(value, low, high, for_axis(p.unit, axis))
        found.append(Told(values, _nothing(held, i, span, once), tuple(bound)))
    return found


def _factor(without: Floats, sizes: int = 1) -> float:
    """Return the standard deviations that hold 95 % of `sizes` found `without` each block, (B, q)."""
    from scipy.special import stdtrit

    return float(stdtrit(max(without.shape[0] - sizes, 1), 0.975))


def _apart(p: Parameter, values: Floats, value: float) -> Floats:
    """Return how far `values` of a parameter are from one `value`, a phase the shorter way round."""
    apart = values - value
    return (apart + np.pi) % (2.0 * np.pi) - np.pi if p.unit == ent.PHASE else apart


def _around(fitted: Fitted, at: int, span: slice) -> dict[str, tuple[float, float]]:
    """Return how far down and up amplitude and phase of a wave may be, whose two sizes are fitted.

    They bend: along a short arc of a wave one size may be open and the other sure, and then the amplitude
    cannot be nothing, though it may be many times its value. So they are read along the edge of what the
    sizes may be.
    """
    term = fitted.terms[at]
    wave = ent.wave_of(term.entry)
    if wave is None or span.stop == span.start:
        return {}
    sizes, without = fitted.coefficients[span], fitted.without[:, span]
    lengths, axes = np.linalg.eigh(scatter(without[:, wave]))
    angles = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    circle = np.sqrt(np.maximum(lengths, 0.0))[:, None] * np.array([np.cos(angles), np.sin(angles)])
    edge = np.tile(sizes, (AROUND, 1))
    edge[:, wave] += _factor(without, 2) * (axes @ circle).T
    if np.sum((axes.T @ sizes[wave]) ** 2 / np.maximum(lengths, 1e-300)) <= _factor(without, 2) ** 2:
        edge[0, wave] = 0.0  # within the edge
    made = [ent.composed(term.entry, one) for one in edge]
    found = {}
    for p in ent.kind_of(term.entry).parameters:
        if p.name in made[0] and (p.unit == ent.PHASE or p.name == ent.AMPLITUDE):
            apart = _apart(p, np.array([one[p.name] for one in made]), float(term.entry[p.name]))
            found[p.name] = float(max(-apart.min(), 0.0)), float(max(apart.max(), 0.0))
    return found


def _nothing(held: Fitted, at: int, span: slice, once: dict[str, float]) -> bool:
    """Tell whether all sizes of a term may be neutral at once; its shape is `held`.

    What they are together counts: of two that blocks tell only as their sum, neither alone is sure.
    """
    entry = held.terms[at].entry
    kind = ent.kind_of(entry)
    names = [n for n in kind.linear if n in entry]
    if span.stop > span.start:
        apart, without = held.coefficients[span], held.without[:, span]
        alone = np.full(apart.size, max((once.get(n, 0.0) for n in names), default=0.0))
    else:
        found = _values(held, at, span, held.without)
        names = [n for n in names if n in found]
        if not names:
            return False
        apart = np.array([float(entry[n]) - ent.neutral(kind, n) for n in names])
        without = np.stack([found[n] for n in names], axis=1)
        alone = np.array([once.get(n, 0.0) for n in names])
    factor, spread = _factor(without, apart.size), scatter(without)
    least = np.maximum(alone**2 - np.diag(spread), 0.0) + (MODEL * apart / factor) ** 2
    spread = spread + np.diag(least)
    scale = np.sqrt(np.diag(spread)) + 1e-300
    away = apart / scale
    return bool(away @ np.linalg.pinv(spread / np.outer(scale, scale), hermitian=True) @ away <= factor**2)


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
    axis, factor = fitter.balance.stage.axis, _factor(fitted.without)
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
    # Where a fast run is in one block only, the others still tell mass and damping, though less well.
    values, sets, sizes = fitter.numbers(_left_out(fitter, fitted, len(BASE)), effects=effects)
    spread = np.maximum(np.diag(scatter(sets)), 0.0)
    factor = _factor(sets)
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
