"""A part of a force balance, to look many things over on: the blocks in which a model leaves most."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rtcomp.diagnosis.fitting.baseline import yields
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import RUN_IN, Segment, way_to

SHARE, FEWEST = 0.15, 2
"""Part of the blocks that are taken, and how many at least."""
UNITS = 12
"""Friction units that do to see from afar where a play is."""


def excerpt(fitter: Fitter, model: Fitted) -> Fitter | None:
    """Return the force balance on the blocks in motion in which a model leaves most, none reserved.

    Each block is a segment of its own, with the way there, which friction remembers; None where nothing
    moves.
    """
    b = fitter.balance
    used, moves = np.flatnonzero(fitter.use), moving(b)
    some = [int(i) for i in np.argsort(-model.errors, kind="stable") if moves[used[i]]]
    if not some:
        return None
    chosen = np.sort(used[some[: max(int(SHARE * used.size), FEWEST)]])
    segments, at = [], 0
    for segment in b.data.segments:
        rows = b.whitening.rows(segment)
        compared = np.arange(rows.start, rows.stop, rows.step)
        of_block = b.block[at : at + compared.size]
        at += compared.size
        for block in chosen:
            own = compared[of_block == block]
            if own.size:
                segments.append(
                    _around(b.whitening.lead, b.whitening.edge, segment, int(own[0]), int(own[-1]))
                )
    data = replace(b.data, segments=tuple(segments))
    sizes = [len(range(*b.whitening.rows(s).indices(s.time.size))) for s in segments]
    other = Fitter(b.on(data, np.repeat(np.arange(len(segments)), sizes)))
    other.offset = fitter.offset
    other.balance.put(b.reaches, b.step)
    return other


def moving(balance: ForceBalance) -> np.ndarray:
    """Tell in which blocks, (B,) bool, the position goes further than noise makes it."""
    x = balance.plain([s.position for s in balance.data.segments])
    went = [float(np.std(x[balance.block == block])) for block in range(balance.blocks)]
    return np.array(went) > 2.0 * balance.noise.rms


def with_few_units(fitter: Fitter, model: Fitted) -> Fitter:
    """Return the same force balance with few friction units, where friction of a model may yield.

    Far cheaper, and enough to see from afar where a play is, but not how far it goes.
    """
    other = fitter.on(fitter.balance.data)
    shortest, longest = yields(fitter.balance, model)
    if shortest < longest:
        step = float(np.log(longest / shortest)) / (UNITS - 1)
        other.balance.put(np.geomspace(shortest, longest, UNITS), step)
    return other


def _around(lead: int, edge: int, segment: Segment, first: int, last: int) -> Segment:
    """Return the part of a segment that has rows `first` to `last` compared, as far as it has rows around."""
    run_in = int(RUN_IN * (last - first))
    begin = max(first - edge - max(run_in - lead, 0), 0)
    part = segment.part(slice(begin, min(last + 1 + edge, segment.time.size)))
    before = way_to(segment, begin) if begin else segment.before
    return replace(part, before=before, run_in=run_in if begin else segment.run_in)
