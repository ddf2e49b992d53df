"""Where to look for each entry of the catalogue: the points of its parameters from which a search starts.

An entry that acts as a force of free size is tried as a column of the ledger (`Column`); one that changes
friction, drive, sensor or motion is tried at work, at a few sizes (`Point`). All sizes come from the
recording at hand: its stroke, speeds, commands, times, and the friction already found.
"""

from __future__ import annotations

from collections.abc import Iterator

from rtcomp.diagnosis.scene import Column, Entry, Point, Scene
from rtcomp.diagnosis.search_at_work import at_work
from rtcomp.diagnosis.search_forces import forces
from rtcomp.physics import Effect, build, catalogue


def searches(scene: Scene) -> Iterator[Column | Point]:
    """Go through everything worth trying on this recording, entry by entry."""
    yield from forces(scene)
    for point in at_work(scene):
        if _known(point.entry):
            yield point


def _known(entry: Entry) -> bool:
    try:
        catalogue.entry(str(entry["name"]))
    except ValueError:
        return False
    return True


def effect_of(entry: Entry) -> Effect:
    """Build the effect of an entry."""
    return build(entry)
