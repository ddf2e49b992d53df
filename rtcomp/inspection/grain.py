"""What a position sensor sees: noise, count, the low-pass that they ask for, the least reversal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rtcomp.inspection.branches import turning_points
from rtcomp.kernels import Floats
from rtcomp.stage.lowpass import zero_phase

STROKE = 0.02
"""A reversal smaller than this part of the stroke is none, however good the sensor."""
NOISE = 8.0
"""... than this many times the noise (rms) after the low-pass; of a million rows one is five times off."""
COUNTS = 1.5
PERIODS = 5.0
"""The low-pass stays this many times above the motion's own frequency, so that its corners stay."""
LEFT = 0.05
"""The low-pass is to bring NOISE times the noise below this part of the usual branch."""
DITHER = 1.0
"""Noise of this many counts smooths the counts away: the low-pass then sees between them."""
_PLATEAU, _TRIMMED, _ROUNDS = 0.02, 0.999, 4


@dataclass(frozen=True)
class Grain:
    """Noise of a position reading, m rms, and its count, m, 0 where it has none."""

    noise: float
    count: float

    @property
    def step(self) -> float:
        """The count (m) as far as noise does not smooth it away; 0 where it does."""
        return self.count if self.noise < DITHER * self.count else 0.0

    def left(self, smoothing_hz: float, rate_hz: float) -> float:
        """Return what of the noise (m rms) a low-pass leaves: white noise through (1 + (f / fc)^4)^-2."""
        passed = 1.67 * smoothing_hz / rate_hz if smoothing_hz > 0.0 else 1.0
        return self.noise * math.sqrt(min(passed, 1.0))


@dataclass(frozen=True)
class Sight:
    """How a recording is looked at: the low-pass (Hz, 0 for none), the least reversal and rest (m)."""

    grain: Grain
    smoothing_hz: float
    reversal: float
    rest: float
    floored: bool = False
    """Whether the sensor asked for a lower low-pass than the motion allows."""


def grain_of(position: Floats) -> Grain:
    """Return noise and count of a recorded position (m, (K,), K >= 8).

    Noise from third differences, which smooth motion hardly has: of white noise their variance is 20 times
    its own; the thousandth largest, jumps and corners of the motion, do not count. The count is the usual
    distance between the values at which the reading stood still.
    """
    third = np.abs(np.diff(position, 3))
    noise = math.sqrt(float(np.mean(third[third <= np.quantile(third, _TRIMMED)] ** 2)) / 20.0)
    still = position[1:][np.diff(position) == 0.0]
    count = 0.0
    if still.size > _PLATEAU * position.size:
        steps = np.diff(np.unique(still))
        steps = steps[steps > 1e-9 * float(np.ptp(position))]
        count = float(np.median(steps)) if steps.size else 0.0
    return Grain(noise, count)


def sight_of(
    position: Floats,
    rate_hz: float,
    most_hz: float,
    smoothing_hz: float | None = None,
    reversal: float | None = None,
) -> Sight:
    """Return how to look at a position (m, (K,), evenly spaced at `rate_hz`); what is given stays.

    The low-pass is as gentle as the sensor allows, at most `most_hz`: it leaves noise that is small against
    the usual branch, and the motion at its mean speed passes one count while the low-pass looks (about
    1 / (2 pi f)); it is never below PERIODS times the frequency of the motion. That is known from the
    reversals, which are seen through the low-pass, so both are found in turns.
    """
    grain = grain_of(position)
    cut = most_hz if smoothing_hz is None else smoothing_hz
    floored = False
    for _ in range(_ROUNDS):
        slow = zero_phase(position, cut, rate_hz) if cut > 0.0 else position
        left = grain.left(cut, rate_hz)
        least = max(STROKE * float(np.ptp(slow)), NOISE * left, COUNTS * grain.step)
        least = least if reversal is None else reversal
        turns = turning_points(slow, least)
        if smoothing_hz is not None or turns.size < 2:
            break
        ways = np.abs(np.diff(slow[turns]))
        seconds = float(turns[-1] - turns[0]) / rate_hz
        frequency = 0.5 * ways.size / seconds
        wanted = most_hz
        if grain.noise > 0.0:
            wanted = min(
                wanted, rate_hz / 1.67 * (LEFT * float(np.median(ways)) / (NOISE * grain.noise)) ** 2
            )
        if grain.step > 0.0:
            wanted = min(wanted, float(ways.sum()) / seconds / (2.0 * math.pi * grain.step))
        floored = wanted < PERIODS * frequency
        wanted = min(max(wanted, PERIODS * frequency), most_hz)
        if abs(wanted / cut - 1.0) < 0.02:
            break
        cut = wanted
    return Sight(grain, cut, least, 2.0 * left, floored)
