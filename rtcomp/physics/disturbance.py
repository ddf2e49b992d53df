"""Forces from outside: a bias, a tone."""

from __future__ import annotations

import math

from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.wires import PUSH, TIME


@effect_kernel
def constant_force(p: Floats, s: Floats, w: Floats) -> None:
    """p: force (N)."""
    w[PUSH] += p[0]


@effect_kernel
def tonal_disturbance(p: Floats, s: Floats, w: Floats) -> None:
    """p: amplitude (N), frequency (Hz), phase (rad)."""
    w[PUSH] += p[0] * math.sin(2.0 * math.pi * p[1] * w[TIME] + p[2])


@register
class ConstantForce(Effect):
    """A bias."""

    name = "constant-force"
    place = Place.DISTURBANCE
    parameters = (Parameter("force", "N", -1e6, 1e6, "force on the mass"),)
    kernel = constant_force
    says = "a constant force acts on the mass"
    equation = "F = force"
    source = "Newton's second law"
    signature = "residual force that is the same everywhere, at all times and in both directions"
    experiment = "the same slow stroke in both directions"
    example = {"force": 1.5}
    neutral = {"force": 0.0}
    linear = ("force",)
    bias = True


@register
class TonalDisturbance(Effect):
    """Vibration or mains, a sine of time that starts with the run."""

    name = "tonal-disturbance"
    place = Place.DISTURBANCE
    parameters = (
        Parameter("amplitude", "N", -1e6, 1e6, "size of the force"),
        Parameter("frequency", "Hz", 0.0, 1e5, "its frequency"),
        Parameter("phase", "rad", -100.0, 100.0, "angle at time zero of the run", 0.0),
    )
    kernel = tonal_disturbance
    says = "a force at one frequency: floor vibration, a fan, mains"
    equation = "F = a sin(2 pi f t + phase)"
    source = "Gordon (1999), Proc. SPIE 3786, generic vibration criteria"
    signature = "a line in the spectrum of the residual force, at the same frequency whatever the motion"
    experiment = "holding still for longer than ten periods, then slow motion"
    example = {"amplitude": 0.8, "frequency": 23.0}
    neutral = {"amplitude": 0.0}
    linear = ("amplitude",)
