"""Effects that go by the whole of friction: columns made for a friction at hand, which the fit moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.balance import ForceBalance, System
from rtcomp.diagnosis.entries import Entry
from rtcomp.diagnosis.free import Term
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats

STIFFER = 1.01
"""Times its stiffness by which the whole of friction is made stiffer, to see what asks for that."""
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

    The stiffness of the whole is the sum of the units'. So what asks for it changes with each unit's alike,
    and a fine one, which hardly holds a force, would be free to move it: this is part of their columns.
    Raises ConfigError where a force grows beyond all bounds.
    """
    system, stiffness = balance.system(entries, weights), float(weights.sum())
    if around is None or stiffness <= 0.0 or not goes_by_whole(balance, entries):
        return _bounded(system)
    change = balance.error(entries, around, weights) - balance.error(entries, around, weights, STIFFER)
    change /= (STIFFER - 1.0) * stiffness
    columns = system.columns.copy()
    columns[balance.friction] += change
    return _bounded(System(system.y + stiffness * change, columns, system.of_entry))


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
