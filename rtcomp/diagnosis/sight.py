"""What a recording could have shown: from which size on each entry of the catalogue stands out in it.

An entry is put to work at a modest size beside the final fit. What its force leaves when the base has been
refitted to it is what could be seen; it is held against the floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rtcomp.diagnosis.base import ENTRY_OF, Fitted
from rtcomp.diagnosis.blocks import Blocks, Bounds
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.ledger import BIAS, BIASES, MASS, VISCOUS, Ledger
from rtcomp.diagnosis.motion import Motion, Strip
from rtcomp.diagnosis.result import Retuned, Sight
from rtcomp.diagnosis.scene import Entry, Scene
from rtcomp.diagnosis.typical import Typical, typical
from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats
from rtcomp.physics import Effect, catalogue

SEEN = 2.0
"""Squared force over the floor's, from which on an entry is looked for and found."""
ROWS = 16_000
"""Rows on which it is reckoned, of more in stretches evenly spread."""
STRETCHES = 4
TRIES = 8
"""Sizes that are tried of an entry: not all show in proportion to their size."""
UNSEEABLE = ("sensor-scale",)
"""Entries that scale everything: friction, periods and mass of another size make up for them."""
OWN = {"viscous-friction": VISCOUS, "back-emf": VISCOUS, "inertia": MASS, **dict.fromkeys(BIASES, BIAS)}
"""Entries that are a number of the base: found where it moves, so it is held while they are tried."""


def sight(motion: Motion, final: Fitted, entries: Sequence[Entry], floor: Floats) -> list[Sight]:
    """Return from which size on every entry would have been seen beside `final` with its `entries`.

    `floor` is the squared error (N^2) of every seen block if nothing is missing.
    """
    ledger = final.ledger
    rows = int(np.count_nonzero(ledger.seen[ledger.block]))
    level = float(np.sqrt(SEEN * floor.sum() / max(rows, 1)))
    few = _stretches(motion)
    reduced = Ledger(ledger.stage, few, ledger.reaches, ledger.known)
    reduced.weigh(ledger.weights)
    probe = _Probe(reduced, final, [effect_of(e) for e in entries])
    middle = few.strips[len(few.strips) // 2].time
    # What is there already is not asked for again, but for waves, of which there may be several.
    named = {str(e["name"]) for e in entries if "period" not in e}
    found = []
    for one in typical(Scene.of(motion, final), float(middle[middle.size // 2])):
        if one.name in named:
            continue
        smallest = float(np.inf) if one.name in UNSEEABLE else _smallest(one, probe, level)
        found.append(_sight(one, smallest))
    return found


def pinned(retuned: list[Retuned], sights: Sequence[Sight]) -> tuple[list[Retuned], list[str]]:
    """Return what moved by so much that this motion shows it, and a note for each that it leaves open."""
    from_size = {s.name: s.smallest for s in sights}
    flat = [
        r
        for r in retuned
        if abs(r.after.value - r.before) < 0.5 * from_size.get(ENTRY_OF.get(r.parameter, ""), 0.0)
    ]
    notes = [
        f"{r.parameter} is not pinned by this motion: the stage's is as good as any like it" for r in flat
    ]
    return [r for r in retuned if r not in flat], notes


def _smallest(one: Typical, probe: _Probe, level: float) -> float:
    """Return the size from which on the base leaves a force of `level` (N rms) of an entry."""
    size, most = abs(one.probe), 2.0 * one.most * abs(one.probe)
    hidden, shown = 0.0, float(np.inf)
    for _ in range(TRIES):
        try:
            found = probe.shows({**one.entry, one.size: one.neutral + float(np.copysign(size, one.probe))})
        except (ConfigError, np.linalg.LinAlgError):
            return shown
        if 0.85 * level < found < 1.15 * level:
            return size * level / found
        if size >= most and found < level:
            return float(np.inf)
        hidden, shown = (size, shown) if found < level else (hidden, size)
        if hidden > 0.0 and np.isfinite(shown):
            size = float(np.sqrt(hidden * shown))
        else:
            size = min(size * float(np.clip(level / max(found, 1e-300), 0.05, 5.0)), most)
    return shown


class _Probe:
    """Puts entries to work beside a fit, and tells what force the refitted base leaves of them."""

    def __init__(self, ledger: Ledger, final: Fitted, there: list[Effect]) -> None:
        self._ledger, self._there, self._bounds = ledger, there, final.bounds
        self._plain = ledger.system(there)
        self._known = final.coefficients
        self._residual = self._plain.y - self._plain.columns @ self._known
        self._rows = np.zeros(self._plain.y.size, dtype=np.int64)

    def shows(self, entry: Entry) -> float:
        """Return what the base cannot make up for (N rms), its numbers within their bounds."""
        at_work = self._ledger.system([*self._there, effect_of(entry)])
        target = at_work.y - self._residual
        if not np.isfinite(target).all():
            return 0.0
        low, high = self._bounds.low.copy(), self._bounds.high.copy()
        own = OWN.get(str(entry["name"]))
        if own in at_work.names:
            at = at_work.names.index(own)
            low[at] = high[at] = self._known[at]
        one = Blocks.of(at_work.columns, target, self._rows, 1)
        every = np.array([True])
        error = one.errors(one.solve(every, Bounds(low, high)), np.array([0]))
        return float(np.sqrt(error[0] / target.size))


def _sight(one: Typical, smallest: float) -> Sight:
    cls = catalogue.entry(one.name)
    unit = next(p.unit for p in cls.parameters if p.name == one.size)
    beside = {
        k: float(v)
        for k, v in one.entry.items()
        if k not in ("name", one.size) and isinstance(v, int | float)
    }
    return Sight(one.name, one.size, unit, smallest, one.most * abs(one.probe), beside)


def _stretches(motion: Motion) -> Motion:
    """Return the motion, or of a long one stretches evenly spread over it, with the lead that they need."""
    total = sum(s.time.size for s in motion.strips)
    if total <= ROWS:
        return motion
    count = max(1, STRETCHES // len(motion.strips))
    cut: list[Strip] = []
    for strip in motion.strips:
        length = max(int(strip.time.size * ROWS / total / count), 8 * motion.edge)
        if length * count >= strip.time.size:
            cut.append(strip)
            continue
        for start in np.linspace(0, strip.time.size - length, count).astype(int).tolist():
            rows = slice(start, start + length)
            reference = None if strip.reference is None else strip.reference[rows]
            lead = strip.lead if start == 0 else length // 8
            cut.append(Strip(strip.time[rows], strip.position[rows], strip.voltage[rows], reference, lead))
    return replace(motion, strips=cut)
