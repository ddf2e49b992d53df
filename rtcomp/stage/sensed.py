"""The position that a stage's sensor read: what its effects did to the reading, undone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.kernels import Floats
from rtcomp.physics import Effect, Place
from rtcomp.physics.wires import SENSED
from rtcomp.stage.inverse import undone
from rtcomp.stage.lowpass import zero_phase

MIRRORED = 1000
"""Rows, at most, by which a signal is mirrored at its ends."""


def true_position(
    effects: Sequence[Effect], time: Floats, reading: Floats, averaged: int = 1, smoothed: float = 0.0
) -> Floats:
    """Return the position (m, (K,)) that a sensor with these `effects` would have read as `reading`.

    The inverses of the effects of the sensor, last first, others are left out; a late reading is read where
    it was taken, the last reading standing for those that were still to come. Noise and rounding stay. In
    rows at `time` (s, (K,)) that are means over `averaged` rows of a recording, which was smoothed from
    `smoothed` Hz on (0: was not), a jump of the sensor is no step either.
    """
    position = np.array(reading, dtype=np.float64)
    sensors = sorted((e for e in effects if e.place is Place.SENSOR), key=lambda e: -e.order)
    for effect in sensors:
        if effect.name == "sensor-jump" and (averaged > 1 or smoothed > 0.0):
            position -= effect.values["size"] * _after(effect.values["time"], time, averaged, smoothed)
        elif effect.inverse is not None:
            position = undone(effect, time, position, SENSED)
        elif (delay := effect.values.get("delay", 0.0)) > 0.0:
            position = _earlier(position, delay / float(time[1] - time[0]))
    return position


def _earlier(signal: Floats, rows: float) -> Floats:
    """Return a signal (K,) read so many `rows` later than it is, all frequencies as strong as they were.

    By its Fourier series, mirrored beyond its ends: a polynomial between rows would take noise away, and a
    reading that is late by half a row would look like a better sensor.
    """
    pad = min(signal.size - 1, MIRRORED)
    before, after = 2.0 * signal[0] - signal[pad:0:-1], 2.0 * signal[-1] - signal[-2 : -pad - 2 : -1]
    long = np.concatenate([before, signal, after])
    at = np.arange(long.size)
    slope = (long[-1] - long[0]) / (long.size - 1)
    turned = np.fft.rfft(long - slope * at) * np.exp(2j * np.pi * rows * np.fft.rfftfreq(long.size))
    found = np.fft.irfft(turned, long.size) + slope * (at + rows)
    found = np.asarray(found[pad : pad + signal.size])
    found[np.arange(signal.size) + rows > signal.size - 1] = signal[-1]
    return found


def _after(moment: float, time: Floats, averaged: int, smoothed: float) -> Floats:
    """Return what became of a step at `moment` (s) from 0 to 1 on its way to the rows at `time` (s, (K,))."""
    period = float(time[1] - time[0])
    share = ((np.arange(averaged) + 0.5) / averaged - 0.5) * period
    after = (time[:, np.newaxis] + share >= moment).astype(np.float64).ravel()
    if smoothed > 0.0:
        after = zero_phase(after, smoothed, averaged / period)
    return np.asarray(after.reshape(-1, averaged).mean(axis=1))
