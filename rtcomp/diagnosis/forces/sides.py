"""Which side of the balance a dead time is taken on: the one on which it can be written exactly."""

from __future__ import annotations

from collections.abc import Iterable

from rtcomp.physics import Effect, Place


def exact(effects: Iterable[Effect], held: bool) -> list[Effect]:
    """Return effects in the order of a chain, each on the side of the balance on which it is exact.

    No recording tells a late reading from a late command. A command that is `held` is known exactly between
    rows, so the delay is applied to the command. A reading that is shifted beside a band-limited command is
    exact, so there the delay is applied to the reading.
    """
    place = Place.SENSOR if held else Place.DRIVE
    found = [(e.equivalent() or e) if e.place is place else e for e in effects]
    return sorted(found, key=lambda e: (e.place, e.order))
