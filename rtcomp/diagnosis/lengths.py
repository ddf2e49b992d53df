"""Places beside a sensor's scale: what repeats every millimetre of readings repeats in other true lengths.

Searches see readings, entries state true lengths: a scale that joins or leaves takes the places of all others
along, or they would be waves of another period and the scale would gain nothing beside them.
"""

from __future__ import annotations

from collections.abc import Sequence

from rtcomp.diagnosis.scene import Entry
from rtcomp.physics import Place, catalogue

SCALE = "sensor-scale"
PLACES = ("period", "position")
"""Parameters (m) that say where along the way something is;"""
LISTS = ("knots",)
"""and lists of such."""


def beside(entries: Sequence[Entry], found: Entry) -> list[Entry]:
    """Return `entries` with one more, as a search `found` it: its places in readings (m)."""
    if found["name"] == SCALE:
        return [*(_longer(e, _scale(found)) for e in entries), found]
    factor = 1.0
    for entry in entries:
        factor *= _scale(entry)
    return [*entries, _longer(found, factor)]


def left_out(entries: Sequence[Entry], at: int) -> list[Entry]:
    """Return `entries` without the one at place `at`."""
    others = [e for i, e in enumerate(entries) if i != at]
    return [_longer(e, 1.0 / _scale(entries[at])) for e in others]


def has_places(entries: Sequence[Entry]) -> bool:
    """Tell whether a sensor's scale would take something of `entries` along."""
    return any(_longer(e, 2.0) != e for e in entries)


def _scale(entry: Entry) -> float:
    """Return true over read length, 1 of what does not change that."""
    return float(entry["scale"]) if entry["name"] == SCALE else 1.0  # type: ignore[arg-type]


def _longer(entry: Entry, factor: float) -> Entry:
    """Return an entry with its places further apart; what is the sensor's own stays in readings."""
    if factor == 1.0 or catalogue.entry(str(entry["name"])).place is Place.SENSOR:
        return entry
    moved = {p: factor * float(entry[p]) for p in PLACES if p in entry}  # type: ignore[arg-type]
    lists = {p: [factor * k for k in entry[p]] for p in LISTS if p in entry}  # type: ignore[attr-defined]
    return {**entry, **moved, **lists}
