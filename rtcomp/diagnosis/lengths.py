"""Lengths beside what the sensor reads otherwise: entries state true ones, searches see readings.

A wave that recurs every millimetre of readings recurs in other true lengths where the scale is another, and a
drag by the square of speed has another coefficient. A scale that joins or leaves takes the numbers of all
others along; else they would fit no more, and the scale would gain nothing beside them.
"""

from __future__ import annotations

from collections.abc import Sequence

from rtcomp.diagnosis.scene import Entry
from rtcomp.physics import Place, catalogue

SCALE = "sensor-scale"
METRES = {
    "m": 1, "m/s": 1, "1/m": -1, "N/m": -1, "N s/m": -1, "kg": -1, "N s^2/m^2": -2, "N/m^3": -3,
}  # fmt: skip
"""Powers of a length in the units of parameters, forces given: a mass is a force by an acceleration."""
PLACES, LISTS = ("period", "position"), ("knots",)
"""Parameters (m) that say where along the way something is, and lists of such."""


def beside(entries: Sequence[Entry], found: Entry) -> list[Entry]:
    """Return `entries` with one more, as a search `found` it: in lengths as they are read (m)."""
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


def takes_along(found: Entry, entries: Sequence[Entry]) -> bool:
    """Tell whether numbers of `entries` must be found anew with `found`, which changes what is read."""
    if found["name"] == SCALE:
        return any(_longer(e, 2.0) != e for e in entries)
    return _of_sensor(found) and has_places(entries)


def has_places(entries: Sequence[Entry]) -> bool:
    """Tell whether something of `entries` is somewhere along the way."""
    return any(key in e for e in entries if not _of_sensor(e) for key in (*PLACES, *LISTS))


def _of_sensor(entry: Entry) -> bool:
    return catalogue.entry(str(entry["name"])).place is Place.SENSOR


def _scale(entry: Entry) -> float:
    """Return true over read length, 1 of what does not change that."""
    return float(entry["scale"]) if entry["name"] == SCALE else 1.0  # type: ignore[arg-type]


def _longer(entry: Entry, factor: float) -> Entry:
    """Return an entry for lengths so many times as long; what is the sensor's own stays in readings."""
    if factor == 1.0 or _of_sensor(entry):
        return entry
    moved: Entry = dict(entry)
    for parameter in catalogue.entry(str(entry["name"])).parameters:
        value, power = entry.get(parameter.name), METRES.get(parameter.unit, 0)
        if power and isinstance(value, int | float):
            moved[parameter.name] = factor**power * float(value)
    for key in LISTS:
        if key in entry:
            moved[key] = [factor * k for k in entry[key]]  # type: ignore[attr-defined]
    return moved
