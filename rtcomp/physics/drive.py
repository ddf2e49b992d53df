"""The drive: from the voltage commanded to the force on the mass.

Orders, lowest first. Up to `drive-force` effects work on the voltage (VOLTS) or on the force per volt (GAIN);
after it, on forces::

    10  drive-offset       VOLTS + offset
    20  drive-delay        VOLTS of a while ago (see `delay`)
    30  drive-deadband     VOLTS shrunk by the width
    40  drive-saturation   VOLTS held within +-limit
    50  drive-lag          VOLTS through a first-order lag
    60  drive-gain         GAIN times gain
    65  torque-ripple      GAIN times 1 + a periodic part
    70  drive-force        DRIVE = GAIN VOLTS; every stage has it, none lists it
    80  back-emf           DRIVE less coefficient times speed
    90  cogging            PUSH plus a periodic part, whatever the command

Phases follow one rule everywhere: sin(2 pi x / period + phase), or the triangle of that angle.
"""

from __future__ import annotations

import math

from rtcomp.kernels import Floats, compiled, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.lists import ListEffect
from rtcomp.physics.waves import PERIOD, PHASE, SINE, TRIANGLE, triangle
from rtcomp.physics.wires import DRIVE, GAIN, POSITION, PUSH, STEP, VELOCITY, VOLTS

FORCE_ORDER = 70
"""Order of `drive-force`."""


@effect_kernel
def drive_offset(p: Floats, s: Floats, w: Floats) -> None:
    """p: offset (V)."""
    w[VOLTS] += p[0]


@effect_kernel
def drive_offset_inverse(p: Floats, s: Floats, w: Floats) -> None:
    """p: offset (V)."""
    w[VOLTS] -= p[0]


@effect_kernel
def drive_deadband(p: Floats, s: Floats, w: Floats) -> None:
    """p: width (V)."""
    w[VOLTS] = math.copysign(max(abs(w[VOLTS]) - p[0], 0.0), w[VOLTS])


@effect_kernel
def drive_deadband_inverse(p: Floats, s: Floats, w: Floats) -> None:
    """p: width (V). No voltage asks for none; anything else is shifted outside the band."""
    if w[VOLTS] != 0.0:
        w[VOLTS] += math.copysign(p[0], w[VOLTS])


@effect_kernel
def drive_saturation(p: Floats, s: Floats, w: Floats) -> None:
    """p: limit (V)."""
    w[VOLTS] = min(max(w[VOLTS], -p[0]), p[0])


@effect_kernel
def drive_lag(p: Floats, s: Floats, w: Floats) -> None:
    """p: time constant (s); s: lagged voltage (V). VOLTS becomes its exact mean over a step with VOLTS held.

    At a step of no length, that of this instant.
    """
    passed, before = w[STEP] / p[0] if p[0] > 0.0 else math.inf, s[0] - w[VOLTS]
    s[0] = w[VOLTS] + before * math.exp(-passed)
    w[VOLTS] += before * (-math.expm1(-passed) / passed if passed > 0.0 else 1.0)


@effect_kernel
def drive_lag_inverse(p: Floats, s: Floats, w: Floats) -> None:
    """p: time constant (s); s: lagged voltage (V). VOLTS becomes what, held, gives it at the step's end."""
    keep = math.exp(-w[STEP] / p[0]) if p[0] > 0.0 else 0.0
    wanted = w[VOLTS]
    if keep < 1.0:
        w[VOLTS] = (wanted - s[0] * keep) / (1.0 - keep)
        s[0] = wanted


@effect_kernel
def drive_gain(p: Floats, s: Floats, w: Floats) -> None:
    """p: gain (1)."""
    w[GAIN] *= p[0]


@effect_kernel
def torque_ripple(p: Floats, s: Floats, w: Floats) -> None:
    """p: amplitude (1), period (m), phase (rad)."""
    w[GAIN] *= 1.0 + p[0] * math.sin(2.0 * math.pi * w[POSITION] / p[1] + p[2])


@effect_kernel
def torque_ripple_triangle(p: Floats, s: Floats, w: Floats) -> None:
    """p: amplitude (1), period (m), phase (rad)."""
    w[GAIN] *= 1.0 + p[0] * triangle(2.0 * math.pi * w[POSITION] / p[1] + p[2])


@effect_kernel
def drive_force(p: Floats, s: Floats, w: Floats) -> None:
    """No parameters."""
    w[DRIVE] += w[GAIN] * w[VOLTS]


@effect_kernel
def back_emf(p: Floats, s: Floats, w: Floats) -> None:
    """p: coefficient (N s/m)."""
    w[DRIVE] -= p[0] * w[VELOCITY]


@compiled
def _harmonics(p: Floats, angle: float) -> float:
    """Return the force of the harmonics in the parameters of `cogging`."""
    force = 0.0
    for i in range(int(p[3])):
        force += p[5 + 3 * i] * math.sin(p[4 + 3 * i] * angle + p[6 + 3 * i])
    return force


@effect_kernel
def cogging(p: Floats, s: Floats, w: Floats) -> None:
    """p: amplitude (N), period (m), phase (rad), count, then order, amplitude and phase of each harmonic."""
    angle = 2.0 * math.pi * w[POSITION] / p[1]
    w[PUSH] += p[0] * math.sin(angle + p[2]) + _harmonics(p, angle)


@effect_kernel
def cogging_triangle(p: Floats, s: Floats, w: Floats) -> None:
    """p: as `cogging`; the harmonics are sines."""
    angle = 2.0 * math.pi * w[POSITION] / p[1]
    w[PUSH] += p[0] * triangle(angle + p[2]) + _harmonics(p, angle)


@register
class DriveOffset(Effect):
    """Constant added to the command."""

    name = "drive-offset"
    place = Place.DRIVE
    parameters = (Parameter("offset", "V", -1e3, 1e3, "voltage added to the command"),)
    kernel = drive_offset
    inverse = drive_offset_inverse
    says = "a constant voltage is added to the command, as an amplifier's offset"
    equation = "u <- u + offset"
    source = "amplifier data sheets: input offset voltage"
    signature = "residual force that is the same everywhere, at rest and in both directions"
    experiment = "the same slow stroke in both directions, and holding still"
    example = {"offset": 0.4}
    neutral = {"offset": 0.0}
    linear = ("offset",)
    steady = True
    command_only = True
    bias = True
    order = 10


@register
class DriveDeadband(Effect):
    """No force inside a band around zero volts."""

    name = "drive-deadband"
    place = Place.DRIVE
    parameters = (Parameter("width", "V", 0.0, 1e3, "half width of the band without force"),)
    kernel = drive_deadband
    inverse = drive_deadband_inverse
    says = "the drive gives no force for small commands, and outside the band as much less"
    equation = "u <- sgn(u) max(|u| - width, 0)"
    source = "Tao, Kokotovic (1996), Adaptive Control of Systems with Actuator and Sensor Nonlinearities"
    signature = "residual force with the sign of the command and constant size beyond a small command"
    experiment = "slow strokes whose command passes through zero often"
    example = {"width": 0.5}
    neutral = {"width": 0.0}
    linear = ("width",)
    steady = True
    command_only = True
    order = 30


@register
class DriveSaturation(Effect):
    """Force stops growing beyond a voltage."""

    name = "drive-saturation"
    place = Place.DRIVE
    parameters = (
        Parameter("limit", "V", 0.0, 1e6, "voltage at which the force stops growing", open_low=True),
    )
    kernel = drive_saturation
    says = "the drive's output stops growing at a limit"
    equation = "u <- min(max(u, -limit), limit)"
    source = "Tao, Kokotovic (1996), Adaptive Control of Systems with Actuator and Sensor Nonlinearities"
    signature = "residual force only at the largest commands, with their sign, growing with what is cut off"
    experiment = "fast accelerations that ask for the full voltage"
    example = {"limit": 0.9}
    neutral = {"limit": 1e6}
    steady = True
    command_only = True
    order = 40


@register
class DriveLag(Effect):
    """First-order lag between command and force."""

    name = "drive-lag"
    place = Place.DRIVE
    parameters = (Parameter("time_constant", "s", 0.0, 1e2, "of amplifier and winding (L / R)"),)
    kernel = drive_lag
    inverse = drive_lag_inverse
    says = "the force follows the command with a first-order lag, as the current in a winding does"
    equation = "T du'/dt = u - u'"
    source = "L di/dt = u - R i; Leonhard (2001), Control of Electrical Drives, T = L / R"
    signature = "residual force in proportion to how fast the command changes"
    experiment = "a chirp or steps of the command up to several times the bandwidth"
    example = {"time_constant": 5e-3}
    neutral = {"time_constant": 0.0}
    linear = ("time_constant",)
    command_only = True
    averages = True
    order = 50
    states = 1


@register
class DriveGain(Effect):
    """Force per volt is not what was believed."""

    name = "drive-gain"
    place = Place.DRIVE
    parameters = (Parameter("gain", "1", 0.0, 1e3, "true over believed force per volt", open_low=True),)
    kernel = drive_gain
    says = "the force per volt differs from the believed one by a factor"
    equation = "force constant <- gain * force constant"
    source = "amplifier and motor data sheets: tolerance of gain and of force constant"
    signature = "residual force in proportion to the command at all speeds and places"
    experiment = "accelerations with and without a known added mass"
    example = {"gain": 1.1}
    neutral = {"gain": 1.0}
    linear = ("gain",)
    steady = True
    command_only = True
    stands_for = "force_constant"
    order = 60


@register
class TorqueRipple(Effect):
    """Force per volt varies along the stroke."""

    name = "torque-ripple"
    place = Place.DRIVE
    parameters = (Parameter("amplitude", "1", -1.0, 1.0, "relative size of the variation"), PERIOD, PHASE)
    kernel = torque_ripple
    forms = {SINE: torque_ripple, TRIANGLE: torque_ripple_triangle}
    says = "the force per volt varies periodically along the stroke"
    equation = "force constant <- force constant (1 + a sin(2 pi x / period + phase))"
    source = "Jahns, Soong (1996), IEEE Trans. Industrial Electronics 43(2), pulsating torque"
    signature = "residual force periodic in position whose size is in proportion to the command"
    experiment = "the same stretch at two loads, or accelerating and coasting"
    example = {"amplitude": 0.1, "period": 5e-4, "phase": 0.3}
    neutral = {"amplitude": 0.0}
    linear = ("amplitude",)
    order = 65


class DriveForce(Effect):
    """The step from voltage to force that every drive has; not in the catalogue, since no stage lists it."""

    name = "drive-force"
    place = Place.DRIVE
    parameters = ()
    kernel = drive_force
    says = "the voltage, through the force constant, becomes a force"
    equation = "F = force constant * u"
    source = "Lorentz force"
    signature = "the force follows the command"
    experiment = "any motion"
    example = {}
    searchable = False
    steady = True
    command_only = True
    order = FORCE_ORDER


@register
class BackEmf(Effect):
    """Force lost in proportion to speed."""

    name = "back-emf"
    place = Place.DRIVE
    parameters = (Parameter("coefficient", "N s/m", -1e6, 1e6, "force lost per speed", physical_low=0.0),)
    kernel = back_emf
    says = "the voltage that motion induces takes from the force in proportion to speed"
    equation = "F <- F - c v,  c = Kt Ke / R"
    source = "u = R i + Ke w; Leonhard (2001), Control of Electrical Drives"
    signature = "residual force in proportion to speed while the drive is not saturated"
    experiment = "constant speeds with the drive free and with it saturated"
    example = {"coefficient": 6.0}
    neutral = {"coefficient": 0.0}
    linear = ("coefficient",)
    order = 80

    def damping(self) -> float:
        """Return the coefficient (N s/m)."""
        return abs(self.values["coefficient"])


@register
class Cogging(ListEffect):
    """Force periodic in position, whatever the command; `harmonics` lists {order, amplitude, phase}.

    Harmonics are sines in each form.
    """

    name = "cogging"
    place = Place.DRIVE
    parameters = (Parameter("amplitude", "N", -1e6, 1e6, "force of the fundamental"), PERIOD, PHASE)
    element = (
        Parameter("order", "1", 0.0, 1e3, "periods of the harmonic in one of the fundamental", open_low=True),
        Parameter("amplitude", "N", -1e6, 1e6, "force of the harmonic"),
        PHASE,
    )
    list_name = "harmonics"
    list_needed = False
    list_owner = "harmonics"
    kernel = cogging
    forms = {SINE: cogging, TRIANGLE: cogging_triangle}
    says = "the magnets pull towards preferred places, whatever the command"
    equation = "F = a sin(2 pi x / period + phase) + sum a_k sin(order_k 2 pi x / period + phase_k)"
    source = "Jahns, Soong (1996), IEEE Trans. Industrial Electronics 43(2), cogging torque"
    signature = "residual force periodic in position, alike at all speeds, in both directions and at any load"
    experiment = "slow strokes over several periods in both directions"
    example = {"amplitude": 1.2, "period": 5e-4, "phase": 0.3}
    neutral = {"amplitude": 0.0}
    linear = ("amplitude",)
    steady = True
    order = 90

    def stiffness(self) -> float:
        """Return the steepest slope of force against position (N/m)."""
        slope = 2.0 * math.pi / self.values["period"]
        terms = [(1.0, self.values["amplitude"], 0.0), *self.elements]
        return slope * sum(abs(order * amplitude) for order, amplitude, _ in terms)
