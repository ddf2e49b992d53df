"""What is believed of the columns of a force balance: a prior and bounds for each coefficient."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import BASE, ForceBalance
from rtcomp.diagnosis.numerics.regression import Prior, System
from rtcomp.diagnosis.settings import BELIEF_SD
from rtcomp.kernels import Floats

BELIEVABLE = 5.0
"""Prior standard deviations by which a number may be larger than believed and need no explanation. Within so
many of its believed size an effect may always be."""


def as_held(balance: ForceBalance, prior: Prior) -> Prior:
    """Return a prior with the precisions of believed numbers as the belief alone holds them (`baseline`)."""
    held, first = balance.let_go, len(BASE)
    if not held.size:
        return prior
    precision, sizes = prior.precision.copy(), slice(balance.size, balance.size + held.size - first)
    precision[:first] *= held[:first]
    precision[sizes] *= held[first:]
    return Prior(prior.mean, precision, prior.low, prior.high)


def prior_of(balance: ForceBalance, terms: Sequence[Term], system: System, *, offset: bool) -> Prior:
    """Return what is believed: mass, damping and sizes near the belief, no negative stiffness.

    `terms` are those of the believed entries whose sizes are refitted, then those of the model; with `offset`
    there may be a constant force that nobody believes.
    """
    m, believed = balance.stage.mechanics, terms[: len(balance.believed)]
    size = system.columns.shape[0]
    mean, precision = np.zeros(size), np.zeros(size)
    low, high = np.full(size, -np.inf), np.full(size, np.inf)
    low[: balance.size] = 0.0
    for i, value in enumerate((m.mass, m.viscous, m.micro_damping)):
        if value > 0.0:
            mean[i], precision[i] = value, (BELIEF_SD * value) ** -2
        elif balance.without(BASE[i]):
            high[i] = 0.0
    mean[balance.model], precision[balance.model] = 1.0, BELIEF_SD**-2
    low[0] = 1e-3 * m.mass
    if balance.believed_speed is None:
        low[balance.faster], high[balance.faster] = -balance.speed_room, balance.speed_room
    else:
        off = math.log(balance.believed_speed / m.micro_damping_speed)
        mean[balance.faster], low[balance.faster] = m.micro_damping * off, -np.inf
        precision[balance.faster] = (BELIEF_SD * m.micro_damping) ** -2
    if offset and not any(ent.kind_of(t.entry).bias for t in terms):
        low[balance.size - 1] = -np.inf
    else:
        high[balance.size - 1] = 0.0
    for term, span in zip(terms, system.of_entry, strict=True):
        if span.stop > span.start:
            low[span], high[span] = ent.bounds_of(term.entry)
    for term, span in zip(believed, system.of_entry, strict=False):
        sizes = ent.sizes_of(term.entry)
        # What is believed is possible, on whichever side of nothing a search would look for it.
        wide = BELIEVABLE * BELIEF_SD * np.abs(sizes)
        low[span], high[span] = np.minimum(low[span], sizes - wide), np.maximum(high[span], sizes + wide)
        near = sizes != 0.0
        where = np.arange(span.start, span.stop)
        mean[where[near]] = sizes[near]
        precision[where[near]] = (BELIEF_SD * np.abs(sizes[near])) ** -2
    return Prior(mean, precision, low, high)


def beyond_belief(balance: ForceBalance, model: Fitted) -> bool:
    """Tell whether a believed number of a model is so much larger than believed that something made it so."""
    return bool(np.any(np.abs(model.coefficients) > _most(balance, model)))


def displaces_belief(balance: ForceBalance, model: Fitted, parent: Fitted) -> bool:
    """Tell whether a model has far less mass or friction than is believed, and than its parent has.

    A dead zone of the drive as wide as friction is strong explains most of what friction does, and a lag of
    the drive beside hardly any mass leaves hardly any noise.
    """
    believed = balance.stage.mass, float(balance.weights @ balance.reaches)
    pairs = (model.coefficients[0], parent.coefficients[0]), (model.level, parent.level)
    far = 1.0 + BELIEVABLE * BELIEF_SD
    return any(far * own < min(sure, before) for sure, (own, before) in zip(believed, pairs, strict=True))


def within_belief(balance: ForceBalance, model: Fitted) -> Fitted:
    """Return a model with numbers as far from the belief as they may be, and what it leaves then.

    What is missing may look like a number that nobody would believe: a delay of a drive that works against a
    spring is a damping. What there is to explain is then what is left with numbers that are believed.
    """
    if not beyond_belief(balance, model):
        return model
    most, prior, columns = _most(balance, model), model.prior, model.system.columns
    prior = replace(prior, low=np.maximum(prior.low, -most), high=np.minimum(prior.high, most))
    c = model.grams.solve(~balance.reserved, prior, model.variance)
    errors, rest = model.grams.errors(c, np.flatnonzero(~balance.reserved)), model.system.y - c @ columns
    return replace(model, coefficients=c, weights=c[balance.friction], residual=rest, errors=errors)


def _most(balance: ForceBalance, model: Fitted) -> Floats:
    """Return the largest believable sizes (p,) of a model's coefficients; inf where nothing is believed."""
    believed = model.prior.mean != 0.0
    believed[balance.faster] = False  # a change of a speed
    return np.where(believed, (1.0 + BELIEVABLE * BELIEF_SD) * np.abs(model.prior.mean), np.inf)
