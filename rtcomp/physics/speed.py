"""Friction by speed: viscous, quadratic, micro-damping, Stribeck; differing by direction; late."""

from __future__ import annotations

import math

from rtcomp.kernels import Floats, compiled, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.growing import GROWTH, grow
from rtcomp.physics.level import speed_midway, speed_now, viscous_speed
from rtcomp.physics.wires import (
    ACCELERATION,
    FOLLOWS,
    FRICTION,
    LATE,
    LATE_MIDWAY,
    SKEW,
    STEP,
    STIFFENS,
    VELOCITY,
)  # fmt: skip


@effect_kernel
def viscous(p: Floats, s: Floats, w: Floats) -> None:
    """p: coefficient (N s/m)."""
    w[FRICTION] += p[0] * viscous_speed(w)


@effect_kernel
def micro_damping(p: Floats, s: Floats, w: Floats) -> None:
    """p: coefficient (N s/m), speed (m/s)."""
    ratio = w[VELOCITY] / p[1]
    w[FRICTION] += p[0] * math.exp(-ratio * ratio) * w[VELOCITY]


@compiled
def _fall(p: Floats, w: Floats, now: float, midway: float) -> None:
    """Raise the level by the rise times exp(-now), exp(-midway) in the step's middle."""
    factor, halfway = 1.0 + p[0] * math.exp(-now), 1.0 + p[0] * math.exp(-midway)
    grow(w, factor, halfway, max(p[2], w[STIFFENS]), max(p[3], w[FOLLOWS]))


@effect_kernel
def stribeck(p: Floats, s: Floats, w: Floats) -> None:
    """p: rise (1), velocity (m/s), stiffening (1), following (1)."""
    now, midway = speed_now(w) / p[1], speed_midway(w) / p[1]
    _fall(p, w, now * now, midway * midway)


@effect_kernel
def stribeck_exponential(p: Floats, s: Floats, w: Floats) -> None:
    """p: as `stribeck`."""
    _fall(p, w, abs(speed_now(w) / p[1]), abs(speed_midway(w) / p[1]))


@effect_kernel
def stribeck_root(p: Floats, s: Floats, w: Floats) -> None:
    """p: as `stribeck`."""
    _fall(p, w, math.sqrt(abs(speed_now(w) / p[1])), math.sqrt(abs(speed_midway(w) / p[1])))


@effect_kernel
def asymmetric_viscous(p: Floats, s: Floats, w: Floats) -> None:
    """p: ratio (1)."""
    w[SKEW] = p[0]


@effect_kernel
def frictional_lag(p: Floats, s: Floats, w: Floats) -> None:
    """p: time constant (s), stiffening, following; s: lagged velocity, velocity at the last call (m/s).

    Exact for a velocity that changes linearly over the step.
    """
    v, h = w[VELOCITY], w[STEP]
    if p[0] <= 0.0:
        s[0] = s[1] = v
        w[LATE] = w[LATE_MIDWAY] = 0.0
        return
    before = s[0]
    if h > 0.0:
        keep = math.exp(-h / p[0])
        s[0] = v + (s[0] - s[1]) * keep - (v - s[1]) * -math.expm1(-h / p[0]) * p[0] / h
    s[1] = v
    w[LATE] = v - s[0]
    # What lags changes less over the step than the velocity does.
    w[LATE_MIDWAY] = v - 0.5 * h * w[ACCELERATION] - 0.5 * (before + s[0])
    w[STIFFENS], w[FOLLOWS] = p[1], p[2]


@effect_kernel
def quadratic_drag(p: Floats, s: Floats, w: Floats) -> None:
    """p: coefficient (N s^2/m^2)."""
    w[FRICTION] += p[0] * abs(w[VELOCITY] - w[LATE]) * viscous_speed(w)


@register
class ViscousFriction(Effect):
    """Friction in proportion to speed."""

    name = "viscous-friction"
    place = Place.FRICTION
    parameters = (Parameter("coefficient", "N s/m", -1e6, 1e6, "force per speed", physical_low=0.0),)
    kernel = viscous
    says = "friction in proportion to speed"
    equation = "F = c v"
    source = "Newton's law of viscosity; Armstrong-Helouvry, Dupont, Canudas de Wit (1994), Automatica 30(7)"
    signature = "residual force in proportion to speed, odd in it, alike in both directions"
    experiment = "constant speeds, spaced logarithmically, in both directions"
    example = {"coefficient": 8.0}
    neutral = {"coefficient": 0.0}
    linear = ("coefficient",)
    stands_for = "viscous"

    def damping(self) -> float:
        """Return the coefficient (N s/m)."""
        return abs(self.values["coefficient"])


@register
class QuadraticDrag(Effect):
    """Friction in proportion to speed squared."""

    name = "quadratic-drag"
    place = Place.FRICTION
    parameters = (
        Parameter("coefficient", "N s^2/m^2", -1e9, 1e9, "force per speed squared", physical_low=0.0),
    )
    kernel = quadratic_drag
    says = "friction in proportion to speed squared: air, churned lubricant"
    equation = "F = c |v| v"
    source = "Rayleigh (1876), Philosophical Magazine 2(13), drag in proportion to speed squared"
    signature = "residual force that grows with the square of speed, odd in it"
    experiment = "constant speeds, spaced logarithmically up to the fastest, in both directions"
    example = {"coefficient": 400.0}
    neutral = {"coefficient": 0.0}
    linear = ("coefficient",)

    def damping(self) -> float:
        """Return the slope of the force at 1 m/s (1 rad/s) (N s/m)."""
        return 2.0 * abs(self.values["coefficient"])

    def damping_under(self, force: float) -> float:
        """Return the slope (N s/m) at the speed at which the drag is as large as `force` (N)."""
        return 2.0 * math.sqrt(abs(self.values["coefficient"]) * force)


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
    linear = ("coefficient",)
    searchable = False
    stands_for = "micro_damping"

    def damping(self) -> float:
        """Return the coefficient (N s/m)."""
        return self.values["coefficient"]


@register
class Stribeck(Effect):
    """Friction that falls with speed from its static level.

    It falls as exp(-|v / v_s|^d): d is 2 in the form `gaussian`, 1 in `exponential`, 1/2 in `root`. What
    sticks keeps its force while the level changes; with `following` 1 it follows at once, with `stiffening`
    1 its stiffness does too.
    """

    name = "stribeck"
    place = Place.FRICTION
    parameters = (
        Parameter("rise", "1", -0.9, 10.0, "static over sliding level, less one", physical_low=0.0),
        Parameter("velocity", "m/s", 0.0, 1e3, "speed at which the rise has fallen to 1/e", open_low=True),
        *GROWTH,
    )
    kernel = stribeck
    forms = {"gaussian": stribeck, "exponential": stribeck_exponential, "root": stribeck_root}
    says = "friction falls with speed from its static level: the yield level is higher near rest"
    equation = "yield <- yield (1 + rise exp(-|v / v_s|^d)), d = 2, 1 or 1/2"
    source = "Stribeck (1902); Al-Bender, Lampaert, Swevers (2005), IEEE TAC 50(11), eq. for s(v)"
    signature = "residual peaks at break-away and at low speed, same sign as the motion"
    experiment = "slow constant speeds around the Stribeck speed, and starts from rest"
    example = {"rise": 0.3, "velocity": 2e-3}
    neutral = {"rise": 0.0}
    linear = ("rise",)
    search_grid = {"following": (0.0, 1.0)}
    order = 20


@register
class AsymmetricViscousFriction(Effect):
    """The speed-dependent part differs by direction.

    It weights `viscous-friction`, `quadratic-drag` and the viscous part of a friction model; `micro-damping`
    and the damping of bristles belong to the contacts and stay as they are. Without such a part in the stage
    it is without effect.
    """

    name = "asymmetric-viscous-friction"
    place = Place.FRICTION
    parameters = (
        Parameter("ratio", "1", -1.0, 1.0, "forward less backward over their sum: 1 + ratio and 1 - ratio"),
    )
    kernel = asymmetric_viscous
    says = "friction in proportion to speed is larger in one direction than in the other"
    equation = "c <- c (1 + ratio sgn(v))"
    source = "Janot, Gautier, Brunot (2019), EMPS benchmark: viscous friction by direction"
    signature = "residual force in proportion to the size of speed, with the same sign in both directions"
    experiment = "constant speeds, spaced logarithmically, in both directions"
    example = {"ratio": 0.4}
    neutral = {"ratio": 0.0}
    linear = ("ratio",)
    order = 10


@register
class FrictionalLag(Effect):
    """Friction follows speed late.

    Viscous and quadratic friction and every level that falls with speed (`stribeck`, and that of lugre, gms,
    leuven and modified-leuven, beside what lag these have of themselves) take the lagged speed; damping of
    the contacts does not. `dahl` and stop elements alone have nothing that depends on speed. With
    `following` 1 what sticks follows a level of `stribeck` that changes late, with `stiffening` 1 its
    stiffness does too.
    """

    name = "frictional-lag"
    place = Place.FRICTION
    parameters = (
        Parameter("time_constant", "s", 0.0, 1e2, "with which friction follows speed"),
        *GROWTH,
    )
    kernel = frictional_lag
    says = "the speed-dependent part of friction follows speed late, as the lubricant film builds up"
    equation = "T dv'/dt = v - v',  F = F(v')"
    source = "Hess, Soom (1990), J. Tribology 112(1); Armstrong-Helouvry, Dupont, Canudas de Wit (1994)"
    signature = "friction in sliding differs between speeding up and slowing down: a loop over speed"
    experiment = "speeds that oscillate around the Stribeck velocity without reversal, slowly and fast"
    example = {"time_constant": 2e-2}
    neutral = {"time_constant": 0.0}
    linear = ("time_constant",)
    search_grid = {"following": (0.0, 1.0)}
    order = 5
    states = 2
