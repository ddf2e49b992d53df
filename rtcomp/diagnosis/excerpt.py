"""A part of a force balance, to look many things over on: the blocks in which a model leaves most."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rtcomp.diagnosis.baseline import yields
from rtcomp.diagnosis.data import RUN_IN, Data, Segment, way_to
from rtcomp.diagnosis.fit import Fitter
from rtcomp.diagnosis.fitted import Fitted

SHARE, FEWEST = 0.15, 2
"""Part of the blocks that are taken, and how many at least."""
UNITS = 12
"""Friction units that do to see from afar where a play is."""


def excerpt(fitter: Fitter, model: Fitted) -> Fitter:
    """Return the force balance on the blocks in which a model leaves most, none reserved.

    Each block is a segment of its own, with the way there, which friction remembers.
    """
    b = fitter.balance
    blocks = np.flatnonzero(fitter.use)
    count = max(int(SHARE * blocks.size), FEWEST)
    chosen = np.sort(blocks[np.argsort(-model.errors, kind="stable")[:count]])
    segments, at = [], 0
    for segment in b.data.segments:
        rows = b.whitening.rows(segment)
        compared = np.arange(rows.start, rows.stop, rows.step)
        of_block = b.block[at : at + compared.size]
        at += compared.size
        for block in chosen:
            some = compared[of_block == block]
            if some.size:
                segments.append(
                    _around(b.whitening.lead, b.whitening.edge, segment, int(some[0]), int(some[-1]))
                )
    data = Data(tuple(segments), b.data.rate, b.data.held, b.data.averaged)
    sizes = [len(range(*b.whitening.rows(s).indices(s.time.size))) for s in segments]
    other = Fitter(b.on(data, np.repeat(np.arange(len(segments)), sizes)))
    other.offset = fitter.offset
    other.balance.put(b.reaches, b.step)
    return other


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
    earlier = np.zeros(0) if segment.before is None else segment.before
    before = np.concatenate([earlier, way_to(segment.position, begin)]) if begin else segment.before
    return replace(part, before=before, run_in=run_in if begin else segment.run_in)
