"""The way to a segment, and what is led along it: what swings has a state where the segment begins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis.forces.kinematics import Path
from rtcomp.diagnosis.recordings.data import Segment
from rtcomp.kernels import Floats
from rtcomp.physics import Effect
from rtcomp.stage.balance import forces
from rtcomp.stage.sensed import true_position
from rtcomp.stage.stage import Stage


def way_there(segment: Segment, sensors: Sequence[Effect]) -> Floats | None:
    """Return times and positions on the way to a segment, (2, M), behind what `sensors` did to the reading.

    None where a recording begins with it: nothing went before.
    """
    if segment.before is None or segment.before.shape[1] < 2:
        return None
    if not sensors:
        return segment.before
    time, reading = segment.before
    return np.stack([time, true_position(sensors, time, reading)])


def led_there(
    stage: Stage, chain: list[Effect], segment: Segment, path: Path, sensors: Sequence[Effect] = ()
) -> tuple[Floats, Floats]:
    """Return the moving mass (kg) and the push around the rows (N), each (K,), of effects along a segment.

    They are led along the way to it first, where there is one. Its rows are far apart; a second mass is exact
    for any length of a step in which the first moves at constant speed.
    """
    way = way_there(segment, sensors)
    motion = np.stack([segment.time, path.x, path.v, path.a, segment.voltage])
    first = 0
    if way is not None:
        time, x = way
        v = np.gradient(x, time)
        led = np.stack([time, x, v, np.gradient(v, time), np.zeros(time.size)])[:, :-1]  # it ends at this row
        first, motion = led.shape[1], np.concatenate([led, motion], axis=1)
    f = forces(stage, chain, *motion)
    return f.mass[first:], f.others()[first:]
