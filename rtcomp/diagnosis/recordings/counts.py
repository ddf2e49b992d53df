"""Counts: the step in which a sensor reads, told by the readings where the stage does not state it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.recording.pieces import sample
from rtcomp.recording.reader import Recording
from rtcomp.stage.stage import Stage

if TYPE_CHECKING:
    from rtcomp.diagnosis.recordings.data import Data

SMALL = 10.0
"""Differences of up to so many of the least are looked at: of more, rounding in the file is a part."""
NEAR = 0.05
"""How near to whole numbers of counts differences are on average, in counts: by chance, or where half of them
are odd numbers of a count half as large, that is 0.25."""
FEW = 20
"""Least number of differences."""
NO_CHANGE = 1e-12
"""Part of the largest reading below which a difference is rounding."""


def counted(stage: Stage, data: Data) -> float:
    """Return the count (m) of the sensor that the stage states, else that of the readings; 0 without."""
    return stage.sensor.resolution or data.count


def count_of(recordings: Sequence[Recording]) -> float:
    """Return the count (m) of which all readings are whole numbers apart; 0 where they tell none.

    Least squares over small differences from row to row.
    """
    steps = np.concatenate([_steps(position) for r in recordings for position in _sound(r)])
    if steps.size < FEW:
        return 0.0
    count = float(np.partition(steps, FEW // 2)[FEW // 2])  # a few that are no counts may be less
    small = steps[steps < SMALL * count]
    whole = np.round(small / count)
    count = float((small @ whole) / (whole @ whole))
    off = np.abs(small / count - np.round(small / count))
    return count if small.size >= FEW and np.mean(off) < NEAR else 0.0


def _sound(recording: Recording) -> list[Floats]:
    """Return positions (m) of a recording, all or in parts; NaN where a row is not sound."""
    parts = zip(sample(recording.position), sample(recording.trusted), strict=True)
    return [np.where(sound, x, np.nan) for x, sound in parts]


def _steps(position: Floats) -> Floats:
    """Return what sound neighbours that differ differ by (m, (n,))."""
    steps = np.abs(np.diff(position))
    largest = np.max(np.abs(position), initial=0.0, where=~np.isnan(position))
    return np.asarray(steps[steps > NO_CHANGE * largest])
