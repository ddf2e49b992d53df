"""A second mass that hangs on the first: by a spring (resonance), or within a play (backlash).

The moving mass of the stage is the sum of both; what is behind the coupling is taken from MASS. In the step
the first mass moves at constant speed, as the integrator has it and as recorded rows are read.
"""

from __future__ import annotations

import math
from typing import Final

from rtcomp.kernels import Floats, compiled, effect_kernel
from rtcomp.physics.catalogue import register
from rtcomp.physics.effect import Effect, Parameter, Place
from rtcomp.physics.wires import AHEAD, BEHIND, FRICTION, MASS, MOVED, PLAYED, POSITION, PUSH, STEP, VELOCITY

LOAD_SHARE: Final = 0.6
"""Share of the moving mass that is behind the play, unless said otherwise."""
CONTACT: Final = 300.0
"""Frequency (Hz) of the load on its contact, unless said otherwise."""
CONTACT_DAMPING: Final = 0.1
"""Damping ratio of the load on its contact: it bounces back with about three quarters of its speed."""
FINEST: Final = 0.1
"""Longest step (rad) of the oscillation of a second mass, free or on its contact.

The first mass moves at constant speed in a step. At its end a part of the second's force is missing: a
twelfth of the square of this.
"""
SAME: Final = 1e-9
"""Relative difference of two steps that rounding of their ends makes."""


@compiled
def swing(q: float, r: float, omega: float, zeta: float, h: float) -> tuple[float, float]:
    """Return deflection and rate of a free damped oscillation after `h`: exact, for 0 <= zeta < 1."""
    qq, qr, rq, rr = swinging(omega, zeta, h)
    return qq * q + qr * r, rq * q + rr * r


@compiled
def swinging(omega: float, zeta: float, h: float) -> tuple[float, float, float, float]:
    """Return what a step of `h` makes of deflection and rate: deflection by each, rate by each."""
    decay = zeta * omega
    turning = omega * math.sqrt(1.0 - zeta * zeta)
    fade = math.exp(-decay * h)
    c, s = fade * math.cos(turning * h), fade * math.sin(turning * h) / turning
    return c + decay * s, s, -omega * omega * s, c - decay * s


@effect_kernel
def resonance(p: Floats, s: Floats, w: Floats) -> None:
    """p: frequency (Hz), damping (1), mass ratio (1); s: deflection (m) and speed (m/s) of the second mass.

    The deflection is counted from the first mass, the speed from the ground. s[2:]: a step (s), and what one
    as long makes of them, which costs more than all else.
    """
    omega = 2.0 * math.pi * p[0]
    mass = p[2] * w[MASS]
    w[MASS] -= mass
    h = w[STEP]
    if h > 0.0:
        if abs(h - s[2]) > SAME * h:
            s[2] = h
            s[3], s[4], s[5], s[6] = swinging(omega, p[1], h)
        base = w[MOVED] / h
        q, r = s[0], s[1] - base
        s[0], s[1] = s[3] * q + s[4] * r, s[5] * q + s[6] * r + base
    else:
        s[0] -= w[MOVED]
    w[PUSH] += mass * (omega * omega * s[0] + 2.0 * p[1] * omega * (s[1] - w[VELOCITY]))


@compiled
def contact(q: float, r: float, gap: float, omega: float) -> float:
    """Return the contact's acceleration of the load (m/s^2), towards the middle; it never pulls."""
    depth = abs(q) - gap
    if depth <= 0.0:
        return 0.0
    side = math.copysign(1.0, q)
    return -side * max(omega * omega * depth + 2.0 * CONTACT_DAMPING * omega * r * side, 0.0)


@effect_kernel
def backlash(p: Floats, s: Floats, w: Floats) -> None:
    """p: gap (m), share (1), contact (Hz); s: the load's place in the play (m), speed (m/s, from the ground).

    Forces on the load are a kick at the start of the step; free flight up to the contact and the contact are
    exact. A contact that begins lasts to the end of the step. What runs after this sees the load's motion.
    """
    if p[0] <= 0.0:
        return
    omega = 2.0 * math.pi * p[2]
    mass = p[1] * w[MASS]
    w[MASS] -= mass
    h = w[STEP]
    before = s[0]
    if h > 0.0:
        base = w[MOVED] / h
        q, r = s[0], s[1] - h * w[BEHIND] / mass - base
        left = h
        side = math.copysign(p[0], q)
        if contact(q, r, p[0], omega) == 0.0:  # in flight, up to the end it flies to
            side = math.copysign(p[0], r)
            flight = (side - q) / r if r != 0.0 else h
            if flight < h:
                q, left = side, h - flight
            else:
                q, left = q + r * h, 0.0
        if left > 0.0:
            q, r = swing(q - side, r, omega, CONTACT_DAMPING, left)
            q += side
        s[0], s[1] = q, r + base
        w[MOVED] += q - before
    else:
        s[0] -= w[MOVED]
        w[MOVED] = 0.0
    # Between kicks the speed is a sawtooth; half of the next one gives its middle (Strang 1968).
    speed = s[1] - 0.5 * h * w[BEHIND] / mass
    w[AHEAD] = w[PUSH] - mass * contact(s[0], speed - w[VELOCITY], p[0], omega)
    w[PLAYED] = s[0]
    w[POSITION] += s[0]
    w[VELOCITY], w[PUSH] = speed, 0.0


@effect_kernel
def load_force(p: Floats, s: Floats, w: Floats) -> None:
    """p: gap (m)."""
    if p[0] > 0.0:
        w[BEHIND] = w[FRICTION] - w[PUSH]
        w[FRICTION], w[PUSH] = 0.0, w[AHEAD]
        w[POSITION] -= w[PLAYED]


@register
class Resonance(Effect):
    """Second mass on a spring; `mass_ratio` is its share of the stage's moving mass, `frequency` its own.

    The frequency is that of the second mass while the first is held, where the drive's response has its
    antiresonance; free, both swing at frequency / sqrt(1 - mass_ratio).
    """

    name = "resonance"
    place = Place.MECHANICS
    parameters = (
        Parameter("frequency", "Hz", 0.0, 1e5, "of the second mass with the first held", open_low=True),
        Parameter("damping", "1", 0.0, 0.9, "its damping ratio"),
        Parameter("mass_ratio", "1", 0.0, 0.9, "its share of the moving mass"),
    )
    kernel = resonance
    says = "part of the moving mass hangs on a spring: a tool, a sensor head, an elastic coupling"
    equation = "m_2 (x + q)'' = -m_2 (w^2 q + 2 d w q'),  F = m_2 (w^2 q + 2 d w q'),  m_2 = ratio m"
    source = "Ormondroyd, Den Hartog (1928), Trans. ASME 50, the dynamic vibration absorber"
    signature = "residual force in proportion to acceleration, growing towards one frequency, ringing there"
    experiment = "a chirp through the resonance, or short accelerations followed by rest"
    example = {"frequency": 30.0, "damping": 0.05, "mass_ratio": 0.3}
    neutral = {"mass_ratio": 0.0}
    linear = ("mass_ratio",)
    search_grid = {"damping": (0.01, 0.05, 0.2), "mass_ratio": (0.1, 0.4)}
    moving_mass = True
    order = 20
    states = 7

    def frequency(self) -> float:
        """Return the larger of the frequency of both masses and that of its damping on the first (rad/s)."""
        omega, damping = 2.0 * math.pi * self.values["frequency"], self.values["damping"]
        ratio = self.values["mass_ratio"]
        return omega * max(1.0 / math.sqrt(1.0 - ratio), 2.0 * damping * ratio / (1.0 - ratio))

    def longest_step(self) -> float:
        """Return a tenth of a radian of the second mass (s)."""
        omega = 2.0 * math.pi * self.values["frequency"]
        return FINEST / omega if self.values["mass_ratio"] != 0.0 else math.inf


@register
class Backlash(Effect):
    """Play of +-gap between the driven, measured mass and a load.

    `share` of the moving mass, friction, springs, weight and other forces are behind it, the drive and the
    sensor before it; the load meets either end as a mass on a spring, of the frequency `contact` and damping
    ratio 0.1, that does not pull. It starts in the middle, at rest. `LoadForce` closes it at the end of the
    chain.
    """

    name = "backlash"
    place = Place.MECHANICS
    parameters = (
        Parameter("gap", "m", 0.0, 1.0, "half of the play; 0 is none"),
        Parameter("share", "1", 0.0, 0.95, "part of the moving mass behind it", LOAD_SHARE, open_low=True),
        Parameter("contact", "Hz", 1.0, 1e4, "of the load on the spring of its contact", CONTACT),
    )
    kernel = backlash
    says = "play between drive and load: after a reversal the load stays behind, until it is met with a knock"
    equation = "m_2 (x + q)'' = -k (|q| - gap)^+ sgn(q) - c q' in contact - friction + other forces"
    source = "Nordin, Gutman (2002), Automatica 38(10), controlling mechanical systems with backlash"
    signature = "after each reversal friction and part of the inertia are missing over the same travel"
    experiment = "slow reversals, and strokes of several sizes around the play"
    example = {"gap": 2e-5}
    neutral = {"gap": 0.0}
    behind = True
    order = 30
    states = 2

    def frequency(self) -> float:
        """Return that of load and stage on the contact (rad/s); 0 without a gap."""
        omega = 2.0 * math.pi * self.values["contact"]
        return omega / math.sqrt(1.0 - self.values["share"]) if self.values["gap"] > 0.0 else 0.0

    def longest_step(self) -> float:
        """Return a tenth of a radian of the contact (s)."""
        return FINEST / (2.0 * math.pi * self.values["contact"]) if self.values["gap"] > 0.0 else math.inf

    def companions(self) -> list[Effect]:
        """Return what takes the forces from the mass and gives them to the load."""
        return [LoadForce(**self.values)]


class LoadForce(Effect):
    """The end of a play's step: friction and other forces act on the load. Not in the catalogue."""

    name = "load-force"
    place = Place.FRICTION
    parameters = Backlash.parameters
    kernel = load_force
    says = "friction and other forces act on the load behind the play"
    equation = "F_load <- F,  F <- 0"
    source = "Newton's third law"
    signature = "that of backlash"
    experiment = "that of backlash"
    example = Backlash.example
    neutral = Backlash.neutral
    searchable = False
    order = 100
