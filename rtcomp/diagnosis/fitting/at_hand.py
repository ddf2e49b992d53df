"""Effects that go by the whole of friction: columns made for a friction at hand, which the fit moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.fitting.free import Free, Term, slopes
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.regression import System
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats

MORE = 0.01
"""Part by which stiffness or level of the whole of friction is made larger, to see what asks for it."""
CONSISTENT = 0.02
"""Part of its level by which friction may be away from that which its columns were made for."""
HUGE = 1e150
"""Size of a column beyond which its square is no number."""


def goes_by_whole(balance: ForceBalance, entries: Sequence[Entry]) -> bool:
    """Tell whether one of `entries`, or of the belief, asks for the whole of the friction at hand."""
    return any(e.whole_friction for e in balance.at_work(entries)[2])


def by_weights(balance: ForceBalance, entries: Sequence[Entry]) -> bool:
    """Tell whether columns with `entries` at work depend on the friction at hand."""
    return any(e.whole_friction or e.behind for e in balance.at_work(entries)[2])


def system_around(
    balance: ForceBalance, entries: Sequence[Entry], weights: Floats, around: Floats | None
) -> System:
    """Return the system made for friction of `weights` (N/m), to first order around coefficients (p,).

    Stiffness and level of the whole are sums over the units. So what asks for them changes with each unit's
    own part, and a fine one, which hardly holds a force, would be free to move the stiffness: this is part of
    their columns. Raises ConfigError where a force grows beyond all bounds.
    """
    system = balance.system(entries, weights)
    if around is None or not weights.any() or not goes_by_whole(balance, entries):
        return _bounded(system)
    scale, left = balance.left(entries, around, weights)
    y, columns = system.y, system.columns.copy()
    for each, larger in ((np.ones(weights.size), (1.0 + MORE, 1.0)), (balance.reaches, (1.0, 1.0 + MORE))):
        change = scale * (left - balance.left(entries, around, weights, larger)[1]) / MORE
        columns[balance.friction] += np.outer(each / (each @ weights), change)
        y = y + change
    return _bounded(System(y, columns, system.of_entry))


def tangents_of(
    balance: ForceBalance,
    terms: list[Term],
    free: Sequence[Free],
    system: System,
    c: Floats,
    weights: Floats,
) -> Floats:
    """Return by how much less a model leaves with each free parameter, (q, n), coefficients held."""
    rest = system.y - c @ system.columns
    if free and by_weights(balance, [t.entry for t in terms]):  # its columns may be of another friction
        rest = balance.error([t.entry for t in terms], c, weights)
    return slopes(terms, free, lambda t: rest - balance.error([e.entry for e in t], c, weights), rest.size)


def _bounded(system: System) -> System:
    parts = [part for part in (system.columns, system.y) if part.size]
    if not all(part.max() < HUGE and part.min() > -HUGE for part in parts):
        raise ConfigError(f"a force of {HUGE:g} times the noise on the recorded motion is no stage's")
    return system


def consistent(balance: ForceBalance, made_for: Floats, weights: Floats) -> bool:
    """Tell whether friction (N/m) is that which its columns were made for, within a part of its level."""
    off, level = (float(w @ balance.reaches) for w in (np.abs(weights - made_for), weights))
    return off <= CONSISTENT * max(level, 1e-300)


def newly_behind(terms: Sequence[Term], before: Sequence[Term]) -> bool:
    """Tell whether friction comes to be behind a play, which a fit without one takes for longer reaches."""
    return any(ent.kind_of(t.entry).behind for t in terms) and not any(
        ent.kind_of(t.entry).behind for t in before
    )
