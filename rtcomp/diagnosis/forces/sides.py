"""Which side of the balance a dead time is taken on: the one on which it can be written exactly."""

from __future__ import annotations

from collections.abc import Iterable

from rtcomp.physics import Effect, Place


def exact(effects: Iterable[Effect], held: bool) -> list[Effect]:
    """Return effects in the order of a chain, each on the side of the balance on which it is exact.

    A late reading and a late command leave the same command beside the same reading. A command that is
    `held` from row to row is known between rows, so it is taken to be late; of one that is band-limited,
    reading and command are known alike between rows, and the reading is taken to be.
    """
    place = Place.SENSOR if held else Place.DRIVE
    found = [(e.elsewhere() or e) if e.place is place else e for e in effects]
    return sorted(found, key=lambda e: (e.place, e.order))
