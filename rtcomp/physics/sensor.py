"""The sensor: from the true position to the reading, once a tick.

Orders, lowest first::

    10  sensor-delay           SENSED of a while ago (see `delay`)
    20  sensor-scale           SENSED over scale
    30  sensor-periodic-error  SENSED plus a sine of itself
    40  sensor-drift           SENSED plus a slow change
    50  sensor-jump            SENSED plus a jump
    60  sensor-noise           SENSED plus a random number
    80  sensor-resolution      SENSED to the nearest count
"""

from __future__ import annotations

import math

from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.waves import PERIOD, PHASE
from rtcomp.physics.wires import NOISE, SENSED, TIME


@effect_kernel
def sensor_scale(p: Floats, s: Floats, w: Floats) -> None:
    """p: scale (1)."""
    w[SENSED] /= p[0]


@effect_kernel
def sensor_scale_inverse(p: Floats, s: Floats, w: Floats) -> None:
    """p: scale (1)."""
    w[SENSED] *= p[0]


@effect_kernel
def sensor_periodic_error(p: Floats, s: Floats, w: Floats) -> None:
    """p: amplitude (m), period (m), phase (rad)."""
    w[SENSED] += p[0] * math.sin(2.0 * math.pi * w[SENSED] / p[1] + p[2])


@effect_kernel
def sensor_periodic_error_inverse(p: Floats, s: Floats, w: Floats) -> None:
    """p: amplitude (m), period (m), phase (rad). Newton on x + a sin(k x + phase) = reading.

    One root where |a k| < 1.
    """
    k = 2.0 * math.pi / p[1]
    x = w[SENSED]
    for _ in range(20):
        slope = max(1.0 + p[0] * k * math.cos(k * x + p[2]), 0.05)
        change = (x + p[0] * math.sin(k * x + p[2]) - w[SENSED]) / slope
        x -= change
        if abs(change) < 1e-15 * p[1]:
            break
    w[SENSED] = x


@effect_kernel
def sensor_drift(p: Floats, s: Floats, w: Floats) -> None:
    """p: drift (m), time constant (s)."""
    w[SENSED] += p[0] * -math.expm1(-w[TIME] / p[1])


@effect_kernel
def sensor_drift_inverse(p: Floats, s: Floats, w: Floats) -> None:
    """p: drift (m), time constant (s)."""
    w[SENSED] -= p[0] * -math.expm1(-w[TIME] / p[1])


@effect_kernel
def sensor_jump(p: Floats, s: Floats, w: Floats) -> None:
    """p: size (m), time (s)."""
    if w[TIME] >= p[1]:
        w[SENSED] += p[0]


@effect_kernel
def sensor_jump_inverse(p: Floats, s: Floats, w: Floats) -> None:
    """p: size (m), time (s)."""
    if w[TIME] >= p[1]:
        w[SENSED] -= p[0]


@effect_kernel
def sensor_noise(p: Floats, s: Floats, w: Floats) -> None:
    """p: rms (m)."""
    w[SENSED] += p[0] * w[NOISE]


@effect_kernel
def sensor_resolution(p: Floats, s: Floats, w: Floats) -> None:
    """p: resolution (m)."""
    if p[0] > 0.0:
        w[SENSED] = math.floor(w[SENSED] / p[0] + 0.5) * p[0]


@register
class SensorScale(Effect):
    """A length on the scale is not what was believed."""

    name = "sensor-scale"
    place = Place.SENSOR
    parameters = (
        Parameter(
            "scale", "1", 0.0, 1e3, "true over believed length: a reading of 1 is truly this", None, True
        ),
    )
    kernel = sensor_scale
    inverse = sensor_scale_inverse
    says = "the sensor's unit of length is not what was believed"
    equation = "y = x / scale"
    source = "JCGM 200:2012 (VIM), sensitivity of a measuring system"
    signature = "everything that depends on position or its derivatives off by one factor"
    experiment = "comparison of a long stroke with a second, trusted scale"
    example = {"scale": 1.01}
    neutral = {"scale": 1.0}
    linear = ("scale",)
    other_unit = "m"
    order = 20


@register
class SensorPeriodicError(Effect):
    """Cyclic error of an interferometer, sub-divisional error of an encoder."""

    name = "sensor-periodic-error"
    place = Place.SENSOR
    parameters = (Parameter("amplitude", "m", -1e3, 1e3, "size of the error"), PERIOD, PHASE)
    kernel = sensor_periodic_error
    inverse = sensor_periodic_error_inverse
    says = (
        "the reading errs periodically: cyclic error of an interferometer, sub-divisional error of an encoder"
    )
    equation = "y = x + a sin(2 pi x / period + phase)"
    source = "Wu, Deslattes (1998), Applied Optics 37(28), periodic nonlinearity"
    signature = "apparent acceleration, periodic in position, that grows with the square of speed"
    experiment = "the same stretch slowly and fast"
    example = {"amplitude": 5e-6, "period": 2e-4}
    neutral = {"amplitude": 0.0}
    linear = ("amplitude",)
    order = 30


@register
class SensorDrift(Effect):
    """The reading drifts while frame and scale settle to their temperature."""

    name = "sensor-drift"
    place = Place.SENSOR
    parameters = (
        Parameter("drift", "m", -1e3, 1e3, "change of the reading in the end"),
        Parameter("time_constant", "s", 0.0, 1e7, "with which it comes, from the start", open_low=True),
    )
    kernel = sensor_drift
    inverse = sensor_drift_inverse
    says = "the reading drifts as frame and scale warm up"
    equation = "y = x + drift (1 - exp(-t / T))"
    source = "Bryan (1990), CIRP Annals 39(2), thermal error"
    signature = "position-dependent forces that shift along the stroke with time"
    experiment = "coming back to the same stop or cogging pattern over a long run"
    example = {"drift": 2e-4, "time_constant": 1.5}
    neutral = {"drift": 0.0}
    linear = ("drift",)
    order = 40


@register
class SensorJump(Effect):
    """The reading jumps once: missed counts of an encoder, fringe slip of an interferometer."""

    name = "sensor-jump"
    place = Place.SENSOR
    parameters = (
        Parameter("size", "m", -1e3, 1e3, "by how much"),
        Parameter("time", "s", 0.0, 1e9, "when, from the start of the run"),
    )
    kernel = sensor_jump
    inverse = sensor_jump_inverse
    says = "the reading jumps once and stays off: missed counts, fringe slip"
    equation = "y = x + size from the time on"
    source = "encoder and interferometer data sheets: counting errors beyond the largest speed"
    signature = "one sample of enormous apparent acceleration, everything in position shifted after it"
    experiment = "returning to a mechanical reference before and after fast motion"
    example = {"size": 2e-4, "time": 2.3004}
    neutral = {"size": 0.0}
    linear = ("size",)
    order = 50


@register
class SensorNoise(Effect):
    """White noise of the reading."""

    name = "sensor-noise"
    place = Place.SENSOR
    parameters = (Parameter("rms", "m", 0.0, 1e3, "standard deviation of the reading"),)
    kernel = sensor_noise
    says = "each reading errs at random, independently of the last"
    equation = "y = x + rms * n, n standard normal"
    source = "Bendat, Piersol (2010), Random Data, white noise"
    signature = "a flat spectrum of the reading at rest"
    experiment = "holding still, drive off"
    example = {"rms": 1e-5}
    neutral = {"rms": 0.0}
    searchable = False
    order = 60


@register
class SensorResolution(Effect):
    """Readings come in counts."""

    name = "sensor-resolution"
    place = Place.SENSOR
    parameters = (Parameter("resolution", "m", 0.0, 1e3, "length of one count; 0 is none"),)
    kernel = sensor_resolution
    says = "the reading is rounded to the nearest count"
    equation = "y = resolution * floor(x / resolution + 1/2)"
    source = "Widrow, Kollar (2008), Quantization Noise"
    signature = "readings on a grid; steps in the apparent speed"
    experiment = "the slowest motion that the stage can make"
    example = {"resolution": 2e-5}
    neutral = {"resolution": 0.0}
    searchable = False
    order = 80
