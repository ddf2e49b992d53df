"""What other forms of a model's effects would do: their forces, bent along what they may depend on.

The kernels of the catalogue are not the only forms that an effect may have. Where its form is another, its
force times a smooth function of position, speed, time or of itself makes up for most of it, and for a wave
the same over a period. A force that is a smooth function of position may be any other one. What only does the
same is no further effect.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting.fitted import Fitted, left_out
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.factor import larger_by
from rtcomp.diagnosis.mismatch.where import ROUNDING, as_force, as_white
from rtcomp.diagnosis.numerics.regression import Grams, Prior
from rtcomp.kernels import Floats
from rtcomp.physics import Effect, Place

if TYPE_CHECKING:
    from rtcomp.diagnosis.fitting.fit import Fitter

OTHERS = {1.0: (1 / 2, 1 / 3), 2.0: (2.0, 2 / 3)}
"""Periods of a wave's other harmonics, over the one that was found, by the period after which it repeats: the
one found is the first or the second of them."""
KNOTS = 6
"""Knots over the stroke of splines that tell a smooth function of position: a wave that is there three times
is none."""
SMOOTH = 0.05
"""Part (rms) of a force that they may leave of it."""
LONGER = 0.02
"""Step of the derivative by the period, in waves over the stroke."""


def other_forms(fitter: Fitter, model: Fitted, at: int) -> Floats:
    """Return the columns (q, n) of what other forms of a model's effect number `at` do, if it has any."""
    entry = model.entries[at]
    if ent.kind_of(entry).known_law:
        return np.zeros((0, model.residual.size))
    bent = _bent(fitter.balance, entry, force_of(fitter, model, at))
    return np.concatenate([bent, overtones(fitter, model, entry)])


def variants(fitter: Fitter, model: Fitted, at: int) -> Floats:
    """Return the columns (q, n) that another form of a model's effect number `at` would add by its own law.

    Of a wave its overtones; of a force by the position that no number bends, of what goes by the time of the
    run or by the force of friction another law of that; of what makes friction larger the same cause, which
    makes it so more or less.
    """
    courses = _by_its_own(fitter, model, at)
    return np.concatenate([overtones(fitter, model, model.entries[at]), *courses])


def any_laws(fitter: Fitter, model: Fitted) -> Floats:
    """Return the columns (q, n) that another law of each of a model's effects would add."""
    found = [fitter.variants(model, i) for i in range(len(model.terms))]
    return np.concatenate([np.zeros((0, model.residual.size)), *found])


def force_of(fitter: Fitter, model: Fitted, at: int) -> Floats:
    """Return the force (N, (n,)) of a model's effect number `at`."""
    return fitter.without(model, at) - fitter.force(model)


def _bent(balance: ForceBalance, entry: Entry, force: Floats) -> Floats:
    """Return the whitened columns (q, n) of an entry's `force` (N, (n,)), bent by functions of size 1.

    None of a constant: bent, it is no constant.
    """
    most = float(np.abs(force).max(initial=0.0))
    if not np.isfinite(most) or _size(force) == 0.0:
        return np.zeros((0, force.size))
    others = of_position(balance, entry)
    if others.size:
        return others
    return np.array([as_white(balance, force * bend) for bend in _bends(balance, force / most)])


def of_position(balance: ForceBalance, entry: Entry) -> Floats:
    """Return the whitened columns (q, n) of any other function of position, where an entry's force is one.

    A spring by any law has its zero, and a constant beside it is none.
    """
    none = np.zeros((0, balance.block.size))
    if not ent.adds_force(ent.kind_of(entry)):
        return none
    effect, pairs = ent.build(entry), zip(balance.data.segments, balance.paths(), strict=True)
    force = balance.plain([balance.force_of(effect, segment, path) for segment, path in pairs])
    others = _other_functions(force, balance.plain([p.x for p in balance.paths()]))
    return np.array([as_white(balance, each) for each in others]) if others.size else none


def _other_functions(signal: Floats, position: Floats) -> Floats:
    """Return other smooth functions (q, n) of a position (m, (n,)) than a signal, (n,).

    They are as large as what varies of it, nothing where it is least, and have no part like it. None where
    it is no smooth function of the position.
    """
    from scipy.linalg import null_space

    size, splines = _size(signal), _natural_splines(position)
    parts = splines @ signal / position.size
    if not _size(signal - parts @ splines) < SMOOTH * size:
        return np.zeros((0, signal.size))
    zero = int(np.argmin(np.abs(signal)))
    return np.asarray(size * null_space(parts[None, 1:]).T @ (splines[1:] - splines[1:, zero, None]))


def _size(force: Floats) -> float:
    """Return the size (rms) of what varies of a force, 0 where that is rounding."""
    varies = float(np.std(force))
    return varies if varies > ROUNDING * float(np.abs(force).max(initial=0.0)) else 0.0


def _natural_splines(position: Floats) -> Floats:
    """Return functions (KNOTS, n) that span natural cubic splines of a position (n,), of unit rms.

    Orthogonal, the first a constant (Hastie, Tibshirani, Friedman 2009, The Elements of Statistical Learning,
    section 5.2.1).
    """
    low, high = float(position.min()), float(position.max())
    at, knots = (position - low) / max(high - low, 1e-300), np.linspace(0.0, 1.0, KNOTS)
    cubes = np.maximum(at - knots[:, None], 0.0) ** 3
    bent = (cubes[:-1] - cubes[-1]) / (1.0 - knots[:-1, None])
    span = np.array([np.ones_like(at), at, *(bent[:-1] - bent[-1])])
    return np.asarray(np.sqrt(position.size) * np.linalg.qr(span.T)[0].T)


def other_beliefs(balance: ForceBalance, model: Fitted, besides: str) -> Floats:
    """Return the columns (q, n) of other functions of position than those believed, but of effect `besides`.

    That one is the other form: a spring that hardens beside a belief of a linear one is told by its name.
    """
    found = [np.zeros((0, model.residual.size))]
    for entry, span in zip(balance.believed, model.system.of_entry, strict=False):
        bends = entry["name"] != besides and not ent.kind_of(entry).known_law
        if bends and span.stop > span.start:
            found.append(of_position(balance, ent.composed(entry, model.coefficients[span])))
    return np.concatenate(found)


def _by_its_own(fitter: Fitter, model: Fitted, at: int) -> Iterator[Floats]:
    """Go through the columns (q, n) of another law of what a model's effect number `at` goes by."""
    balance, kind = fitter.balance, ent.kind_of(model.entries[at])
    if not (kind.known_law or ent.shape_parameters(model.entries[at])):
        yield of_position(balance, model.entries[at])
    if ent.goes_by_time(kind):
        yield _bent_along(fitter, model, at, balance.plain([s.time for s in balance.data.segments]))
    if ent.goes_by_friction(kind):
        yield _bent_along(fitter, model, at, _friction(balance, model))
    if kind.place is Place.FRICTION and not (ent.adds_force(kind) or ent.goes_by_time(kind)):
        larger = balance.plain(larger_by(balance, ent.build(model.entries[at])))
        others = _other_functions(larger, balance.plain([p.x for p in balance.paths()]))
        if others.size:
            friction = _friction(balance, model)
            yield np.array([as_white(balance, friction * each) for each in others])
        elif np.ptp(larger) > ROUNDING:
            yield _bent_along(fitter, model, at, larger)


def _friction(balance: ForceBalance, model: Fitted) -> Floats:
    """Return the force (N, (n,)) of a model's friction."""
    own = balance.friction
    return as_force(balance, model.coefficients[own] @ model.system.columns[own])


def _bent_along(fitter: Fitter, model: Fitted, at: int, signal: Floats) -> Floats:
    """Return the whitened columns (2, n) of the force of a model's effect number `at`, bent by a signal."""
    force = force_of(fitter, model, at)
    return np.array([as_white(fitter.balance, force * bend) for bend in _bent_by(signal)])


def overtones(fitter: Fitter, model: Fitted, entry: Entry) -> Floats:
    """Return the columns (q, n) of what makes a wave of one form one of another.

    A period that was fitted without overtones is biased: the last column is what all of them do where they
    are longer, by one factor. Each by its own, they are no wave but any function of the position. None of
    what is no wave, or is a force that does not repeat within the stroke: that is such a function too.
    """
    kind = ent.kind_of(entry)
    phase = next((p.name for p in kind.parameters if p.unit == ent.PHASE), None)
    low, high = fitter.balance.data.stroke
    wave, period = {ent.PERIOD, ent.AMPLITUDE} <= entry.keys(), float(entry.get(ent.PERIOD, 0.0))
    stroke = math.inf if kind.place is Place.FRICTION else high - low  # which goes by position in any way
    if phase is None or not wave or 2.0 * period > stroke:
        return np.zeros((0, model.residual.size))
    still = {n: ent.neutral(kind, n) for n in kind.linear if n in entry and n != ent.AMPLITUDE}
    waves, slopes = np.zeros((0, model.residual.size)), np.zeros((0, model.residual.size))
    repeated = [repeats for repeats in OTHERS if 2.0 * repeats * period <= stroke]
    for over in (one for repeats in repeated for one in OTHERS[repeats]):
        made = []
        for longer in (0.0, LONGER * period / (high - low)):
            other = {**entry, **still, ent.PERIOD: period * over * (1.0 + longer)}
            other.pop("form", None)
            made.append(_quarters(fitter, model, kind, other, phase))
        waves = np.concatenate([waves, made[0]])
        slopes = np.concatenate([slopes, (made[1] - made[0]) / LONGER])
    sizes = _beside(fitter, model, waves)[-1][-waves.shape[0] :]
    return np.concatenate([waves, (sizes @ slopes)[None]])


def _quarters(fitter: Fitter, model: Fitted, kind: type[Effect], wave: Entry, phase: str) -> Floats:
    """Return what a wave does beside a model, and what it does a quarter of a period later, (2, n)."""
    if fitter.linear(kind):
        return float(wave[ent.AMPLITUDE]) * fitter.units([*model.entries, wave])
    return np.array([fitter.change(model, {**wave, phase: at}) for at in (0.0, 0.5 * np.pi)])


def errors_beside(fitter: Fitter, model: Fitted, forms: Floats) -> Floats:
    """Return the squared errors (B_use,) of blocks left out, with other forms (q, n) beside a model.

    Or without them, where these predict no better: a form that is fitted to noise explains nothing.
    """
    if not forms.size:
        return model.errors
    _, joint, prior, whole = _beside(fitter, model, forms)
    found = left_out(joint, fitter.use, prior, model.variance, whole)[0]
    return min(model.errors, found, key=lambda errors: float(np.log(errors).sum()))


def in_any_form(fitter: Fitter, model: Fitted, forms: Floats) -> Fitted:
    """Return what a model would leave with other forms (q, n) beside it."""
    if not forms.size:
        return model
    columns, _, _, whole = _beside(fitter, model, forms)
    return replace(model, residual=model.system.y - whole @ columns)


def _beside(fitter: Fitter, model: Fitted, forms: Floats) -> tuple[Floats, Grams, Prior, Floats]:
    """Return all columns with other forms beside a model, their statistics, prior and coefficients.

    A form is believed to differ by about the effect's own size.
    """
    more = np.concatenate([model.tangents, forms])
    joint, prior = fitter.jointly(model, more)
    prior.precision[-forms.shape[0] :] = 1.0
    columns = np.concatenate([model.system.columns, more])
    return columns, joint, prior, joint.solve(fitter.use, prior, model.variance)


def _bends(balance: ForceBalance, force: Floats) -> Iterator[Floats]:
    """Go through smooth functions (n,) between -1 and 1 of what a force may depend on."""
    paths = balance.paths()
    position = balance.plain([p.x for p in paths])
    time = balance.plain([s.time for s in balance.data.segments])
    for signal in (position, balance.plain([p.v for p in paths]), time, force):
        yield from _bent_by(signal)


def _bent_by(signal: Floats) -> Iterator[Floats]:
    """Go through the first two Legendre polynomials of a signal (n,) over its range."""
    low, high = float(signal.min()), float(signal.max())
    at = (2.0 * signal - low - high) / max(high - low, 1e-300)
    yield at
    yield 1.5 * at**2 - 0.5
