"""The position that a stage's sensor read: what its effects did to the reading, undone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.physics import Effect, Place
from rtcomp.physics.wires import SENSED
from rtcomp.stage.inverse import undone
from rtcomp.stage.lowpass import zero_phase


def true_position(
    effects: Sequence[Effect], time: Floats, reading: Floats, averaged: int = 1, smoothed: float = 0.0
) -> Floats:
    """Return the position (m, (K,)) that a sensor with these `effects` would have read as `reading`.

    The inverses of the effects of the sensor, last first, others are left out; a late reading is read where
    it was taken, by cubic interpolation, the last reading standing for those that were still to come. Noise
    and rounding stay. In rows at `time` (s, (K,)) that are means over `averaged` rows of a recording, which
    was smoothed from `smoothed` Hz on (0: was not), a jump of the sensor is no step either.
    """
    position = np.array(reading, dtype=np.float64)
    sensors = sorted((e for e in effects if e.place is Place.SENSOR), key=lambda e: -e.order)
    for effect in sensors:
        if effect.name == "sensor-jump" and (averaged > 1 or smoothed > 0.0):
            position -= effect.values["size"] * _after(effect.values["time"], time, averaged, smoothed)
        elif effect.inverse is not None:
            position = undone(effect, time, position, SENSED)
        elif (delay := effect.values.get("delay", 0.0)) > 0.0:
            from scipy.interpolate import CubicSpline

            position = CubicSpline(time, position)(np.minimum(time + delay, time[-1]))
    return position


def _after(moment: float, time: Floats, averaged: int, smoothed: float) -> Floats:
    """Return what became of a step at `moment` (s) from 0 to 1 on its way to the rows at `time` (s, (K,))."""
    period = float(time[1] - time[0])
    share = ((np.arange(averaged) + 0.5) / averaged - 0.5) * period
    after = (time[:, np.newaxis] + share >= moment).astype(np.float64).ravel()
    if smoothed > 0.0:
        after = zero_phase(after, smoothed, averaged / period)
    return np.asarray(after.reshape(-1, averaged).mean(axis=1))
