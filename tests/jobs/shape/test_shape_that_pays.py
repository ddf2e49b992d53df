"""A shape that was asked for: kept as far as the motion tells of it."""

from __future__ import annotations

import numpy as np

from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped


def asked_for(seconds, **section):
    """Identify the simulated stage with a section `identify` changed so, from a run that lasts so long."""
    from rtcomp.jobs.identify import identify

    config = Configuration.load(shipped("leuven.yaml"))
    given = {k: v for k, v in config.file.data["identify"].items() if k != "prior"}
    reference = {**config.file.data["reference"], "duration": seconds}
    return identify(config.changed(identify={**given, **section}, reference=reference))


def test_a_shape_asked_for_is_left_off_where_the_motion_says_too_little():
    everything = {"parts": ["reversible", "position", "output"], "places": 5, "groups": 4}
    enough = asked_for(2.0, model="shaped-interval", shape=everything)
    assert enough.model.basis.parts == ("reversible", "position", "output")
    assert not any("left off" in note for note in enough.notes)
    few = asked_for(0.8, model="shaped-interval", shape=everything)
    (note,) = [note for note in few.notes if "left off for want of data" in note]
    left = [part for part in everything["parts"] if f"{part} (" in note]
    assert left and set(few.model.basis.parts) == set(everything["parts"]) - set(left)
    assert few.model.weights.size == few.model.basis.size and np.isfinite(few.model.weights).all()
    assert few.held_out.relative < 0.05
    fewest = asked_for(0.3, model="shaped-interval", shape=everything)
    assert isinstance(fewest.model.basis, IntervalBasis)  # nothing is left of the shape
