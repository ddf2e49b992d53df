"""Friction that depends on speed: viscous, quadratic, micro-damping, Stribeck."""

from __future__ import annotations

import math

from rtcomp.kernels import Floats, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.level import speed_midway
from rtcomp.physics.wires import FRICTION, REACH, VELOCITY


@effect_kernel
def viscous(p: Floats, s: Floats, w: Floats) -> None:
    """p: coefficient (N s/m)."""
    w[FRICTION] += p[0] * w[VELOCITY]


@effect_kernel
def micro_damping(p: Floats, s: Floats, w: Floats) -> None:
    """p: coefficient (N s/m), speed (m/s)."""
    ratio = w[VELOCITY] / p[1]
    w[FRICTION] += p[0] * math.exp(-ratio * ratio) * w[VELOCITY]


@effect_kernel
def stribeck(p: Floats, s: Floats, w: Floats) -> None:
    """p: rise (1), velocity (m/s)."""
    ratio = speed_midway(w) / p[1]
    w[REACH] *= 1.0 + p[0] * math.exp(-ratio * ratio)


@effect_kernel
def quadratic_drag(p: Floats, s: Floats, w: Floats) -> None:
    """p: coefficient (N s^2/m^2)."""
    w[FRICTION] += p[0] * abs(w[VELOCITY]) * w[VELOCITY]


@register
class ViscousFriction(Effect):
    """Friction in proportion to speed."""

    name = "viscous-friction"
    place = Place.FRICTION
    parameters = (Parameter("coefficient", "N s/m", -1e6, 1e6, "force per speed"),)
    kernel = viscous
    says = "friction in proportion to speed"
    equation = "F = c v"
    source = "Newton's law of viscosity; Armstrong-Helouvry, Dupont, Canudas de Wit (1994), Automatica 30(7)"
    signature = "residual force in proportion to speed, odd in it, alike in both directions"
    experiment = "constant speeds, spaced logarithmically, in both directions"
    example = {"coefficient": 8.0}
    neutral = {"coefficient": 0.0}

    def damping(self) -> float:
        """Return the coefficient (N s/m)."""
        return abs(self.values["coefficient"])


@register
class QuadraticDrag(Effect):
    """Friction in proportion to speed squared."""

    name = "quadratic-drag"
    place = Place.FRICTION
    parameters = (Parameter("coefficient", "N s^2/m^2", -1e9, 1e9, "force per speed squared"),)
    kernel = quadratic_drag
    says = "friction in proportion to speed squared: air, churned lubricant"
    equation = "F = c |v| v"
    source = "Rayleigh (1876), Philosophical Magazine 2(13), drag in proportion to speed squared"
    signature = "residual force that grows with the square of speed, odd in it"
    experiment = "constant speeds, spaced logarithmically up to the fastest, in both directions"
    example = {"coefficient": 400.0}
    neutral = {"coefficient": 0.0}

    def damping(self) -> float:
        """Return the slope of the force at 1 m/s (1 rad/s) (N s/m)."""
        return 2.0 * abs(self.values["coefficient"])


@register
class MicroDamping(Effect):
    """Damping of presliding that fades with speed."""

    name = "micro-damping"
    place = Place.FRICTION
    parameters = (
        Parameter("coefficient", "N s/m", 0.0, 1e8, "damping at rest"),
        Parameter("speed", "m/s", 0.0, 1e3, "speed at which it has fallen to 1/e", open_low=True),
    )
    kernel = micro_damping
    says = "damping of the contacts in presliding, fading as sliding begins"
    equation = "F = c exp(-(v / v_m)^2) v"
    source = "Canudas de Wit, Olsson, Astrom, Lischinsky (1995), IEEE TAC 40(3), speed-dependent sigma_1"
    signature = "force in proportion to speed at the lowest speeds only"
    experiment = "small fast oscillations inside presliding"
    example = {"coefficient": 250.0, "speed": 5e-3}
    neutral = {"coefficient": 0.0}

    def damping(self) -> float:
        """Return the coefficient (N s/m)."""
        return self.values["coefficient"]


@register
class Stribeck(Effect):
    """Friction that falls with speed from its static level."""

    name = "stribeck"
    place = Place.FRICTION
    parameters = (
        Parameter("rise", "1", -0.9, 10.0, "static over sliding level, less one"),
        Parameter("velocity", "m/s", 0.0, 1e3, "speed at which the rise has fallen to 1/e", open_low=True),
    )
    kernel = stribeck
    says = "friction falls with speed from its static level: the yield level is higher near rest"
    equation = "yield <- yield (1 + rise exp(-(v / v_s)^2))"
    source = "Stribeck (1902); Al-Bender, Lampaert, Swevers (2005), IEEE TAC 50(11), eq. for s(v)"
    signature = "residual peaks at break-away and at low speed, same sign as the motion"
    experiment = "slow constant speeds around the Stribeck speed, and starts from rest"
    example = {"rise": 0.3, "velocity": 2e-3}
    neutral = {"rise": 0.0}
    order = 20
