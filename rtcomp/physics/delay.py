"""Dead time: a command that acts late, a reading that is old.

Both keep a ring of what came in with its times, HELD entries deep: at the tick rate f that is a delay of
HELD / f, a second at 1 kHz. Of a longer one the oldest entry is used, which makes it as short as that.

In a force balance on recorded rows the drive's delay needs nothing more than its kernel, which gives the mean
over a row. A late reading cannot be undone by a kernel, which sees no future: the recorded position is
shifted by `delay`. No recording tells which of the two is late.
"""

from __future__ import annotations

from typing import Final

from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.wires import SENSED, STEP, TIME, VOLTS

HELD: Final = 1024
"""Entries that the memory of a delay holds."""

_CLOCK, _FIRST, _COUNT, _RING = 0, 1, 2, 3
"""Places in the state: own time (s), index of the oldest entry, number of entries, then times and values."""
DELAY = Parameter("delay", "s", 0.0, 10.0, "by how much it is late")


@effect_kernel
def drive_delay(p: Floats, s: Floats, w: Floats) -> None:
    """p: delay (s); s: own time, oldest entry, number of entries, times and values of the changes.

    VOLTS becomes the mean of the late command over the step, so that its impulse is exact however a change
    falls into a step; at a step of no length, what acts at this instant.
    """
    if p[0] <= 0.0:
        return
    start = s[_CLOCK]
    first, count = int(s[_FIRST]), int(s[_COUNT])
    newest = (first + count - 1) % HELD
    if count == 0 or s[_RING + HELD + newest] != w[VOLTS]:
        if count == 0:  # before the first command there was none
            s[_RING], s[_RING + HELD] = start - p[0] - w[STEP], 0.0
            count = 1
        if count == HELD:
            first = (first + 1) % HELD
            count -= 1
        new = (first + count) % HELD
        s[_RING + new], s[_RING + HELD + new] = start, w[VOLTS]
        count += 1
    s[_CLOCK] = end = start + w[STEP]
    since, until = start - p[0], end - p[0]
    while count > 1 and s[_RING + (first + 1) % HELD] <= since:
        first = (first + 1) % HELD
        count -= 1
    value = s[_RING + HELD + first]
    if w[STEP] > 0.0:
        impulse, at = 0.0, since
        for j in range(1, count):
            i = (first + j) % HELD
            if s[_RING + i] >= until:
                break
            impulse += value * (s[_RING + i] - at)
            at, value = s[_RING + i], s[_RING + HELD + i]
        if at > since:
            value = (impulse + value * (until - at)) / w[STEP]
    w[VOLTS] = value
    s[_FIRST], s[_COUNT] = first, count


@effect_kernel
def sensor_delay(p: Floats, s: Floats, w: Floats) -> None:
    """p: delay (s); s: unused, oldest entry, number of entries, times and values of the readings.

    Between readings the line through them. Called again at the same time, the last call counts.
    """
    if p[0] <= 0.0:
        return
    first, count = int(s[_FIRST]), int(s[_COUNT])
    if count == 0 or s[_RING + (first + count - 1) % HELD] < w[TIME]:
        if count == HELD:
            first = (first + 1) % HELD
            count -= 1
        count += 1
    newest = (first + count - 1) % HELD
    s[_RING + newest], s[_RING + HELD + newest] = w[TIME], w[SENSED]
    due = w[TIME] - p[0]
    while count > 2 and s[_RING + (first + 1) % HELD] <= due:
        first = (first + 1) % HELD
        count -= 1
    after = (first + 1) % HELD
    value = s[_RING + HELD + first]
    if count > 1 and due > s[_RING + first]:
        share = (due - s[_RING + first]) / (s[_RING + after] - s[_RING + first])
        value += share * (s[_RING + HELD + after] - value)
    w[SENSED] = value
    s[_FIRST], s[_COUNT] = first, count


@register
class DriveDelay(Effect):
    """Dead time from command to force.

    It runs before the dead band and what follows; held commands come out exactly `delay` later, in whatever
    steps, whether fractions of a tick or of a step.
    """

    name = "drive-delay"
    place = Place.DRIVE
    parameters = (DELAY,)
    kernel = drive_delay
    says = "the force comes a dead time after the command: a bus, a converter, a computing cycle"
    equation = "u <- u(t - delay)"
    source = "Smith (1957), Chemical Engineering Progress 53(5), control of processes with dead time"
    signature = "residual force in proportion to how fast the command changes, in spikes where it jumps"
    experiment = "a chirp or steps of the command up to five times the bandwidth"
    example = {"delay": 3.3e-3}
    neutral = {"delay": 0.0}
    linear = ("delay",)
    command_only = True
    averages = True
    order = 20
    states = _RING + 2 * HELD

    def equivalent(self) -> Effect:
        """Return a reading that is as late."""
        return SensorDelay(**self.values)


@register
class SensorDelay(Effect):
    """The measurement is late. It runs first in the sensor: readings err as they do at the old position."""

    name = "sensor-delay"
    place = Place.SENSOR
    parameters = (DELAY,)
    kernel = sensor_delay
    says = "the reading shows where the stage was a while ago: filtering, a bus, an interpolator"
    equation = "y = x(t - delay)"
    source = "Smith (1957), Chemical Engineering Progress 53(5), control of processes with dead time"
    signature = "residual force in proportion to the rate of change of all that depends on position and speed"
    experiment = "a chirp of the reference up to five times the bandwidth"
    example = {"delay": 3.3e-3}
    neutral = {"delay": 0.0}
    linear = ("delay",)
    order = 10
    states = _RING + 2 * HELD

    def equivalent(self) -> Effect:
        """Return a command that is as late."""
        return DriveDelay(**self.values)
