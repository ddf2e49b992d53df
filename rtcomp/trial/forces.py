"""What acts on the trial's axis at one moment: drive, weight, springs, friction's level, the sensor."""

from __future__ import annotations

import math

from rtcomp.kernels import Floats, compiled
from rtcomp.trial.axis import Physics

FRESH = 0.01
"""Time at rest (s) after which friction begins to grow."""


@compiled
def bell(x: float, width: float) -> float:
    """Return 1 at x = 0, falling to 1/e at the width."""
    ratio = x / width
    return math.exp(-ratio * ratio)


@compiled
def wave(angle: float, form: float) -> float:
    """Return what repeats every 2 pi: 0 a sine, 1 a triangle, 2 a sine with its second harmonic."""
    if form == 1.0:
        return math.asin(math.sin(angle)) / (0.5 * math.pi)
    if form == 2.0:
        return 0.75 * math.sin(angle) + 0.5 * math.sin(2.0 * angle + 1.0)
    return math.sin(angle)


@compiled
def reading(p: Physics, t: float, x: float) -> float:
    """Return what the sensor says of `x` at `t`, without noise."""
    y = x / p.scale + p.cyclic * math.sin(2.0 * math.pi * x / p.cyclic_period)
    y += p.sensor_drift * (1.0 - math.exp(-t / p.sensor_drift_time))
    return y + (p.jump if t >= p.jump_time else 0.0)


@compiled
def push(p: Physics, t: float, x: float) -> float:
    """Return the forces that friction and drive have no part in."""
    force = p.bias + p.weight - (p.spring + p.spring_cubic * x * x) * x
    if p.spring_square != 0.0:
        force -= p.spring_square * abs(x) * x
    if p.pendulum != 0.0:
        force += p.pendulum * math.sin(x + p.pendulum_phase)
    depth = x - p.stop_position
    if (p.stop_position >= 0.0 and depth > 0.0) or (p.stop_position < 0.0 and depth < 0.0):
        force -= p.stop_stiffness * depth
    if p.tone != 0.0:
        force += p.tone * math.sin(2.0 * math.pi * p.tone_frequency * t + p.tone_phase)
    if p.cogging != 0.0:
        angle = 2.0 * math.pi * x / p.cogging_period + p.cogging_phase
        force += p.cogging * (wave(angle, p.cogging_wave) + p.cogging_second * math.sin(2.0 * angle))
    if p.bump != 0.0:
        force += p.bump * bell(x - p.bump_place, p.bump_width)
    return force


@compiled
def gain(p: Physics, x: float, walk: float) -> float:
    """Return the force per volt here and now."""
    force = p.force_constant * (1.0 + p.walk * walk)
    if p.ripple != 0.0:
        force *= 1.0 + p.ripple * wave(2.0 * math.pi * x / p.ripple_period + p.ripple_phase, p.ripple_wave)
    return force


@compiled
def volts(p: Physics, command: float) -> float:
    """Return what arrives of a command after offset, dead band and saturation."""
    u = command + p.offset
    if abs(u) <= p.deadband:
        return 0.0
    u -= math.copysign(p.deadband, u)
    return max(-p.saturation, min(p.saturation, u))


@compiled
def fallen(speed: float, width: float, exponent: float) -> float:
    """Return exp(-|v / width|^exponent); for the exponent 0 the fall 1 / (1 + (v / width)^2)."""
    if exponent == 2.0:
        return bell(speed, width)
    ratio = abs(speed) / width
    return 1.0 / (1.0 + ratio * ratio) if exponent == 0.0 else math.exp(-(ratio**exponent))


@compiled
def grown(t: float, time: float, form: float) -> float:
    """Return how far a drift has come: 0 exponential, 1 a line, 2 there and back, 3 a line begun late."""
    part = min(t / time, 1.0)
    if form == 1.0:
        return part
    if form == 2.0:
        return math.sin(math.pi * part) ** 2
    if form == 3.0:
        return max(0.0, 2.0 * part - 1.0)
    return 1.0 - math.exp(-t / time)


@compiled
def slip_level(p: Physics, t: float, speed: float, rest: float) -> float:
    """Return the factor on the yield level: Stribeck's fall with speed, drift, growth by time of contact."""
    g = 1.0
    if p.stribeck != 0.0:
        g += p.stribeck * fallen(speed, p.stribeck_speed, p.stribeck_exponent)
    if p.drift_form != 0.0:
        g += p.drift * grown(t, p.drift_time, p.drift_form)
    if p.ageing != 0.0:
        g += p.ageing * math.log10(1.0 + rest / FRESH)
    return g


@compiled
def scale(p: Physics, t: float, x: float, load: float) -> float:
    """Return the factor on the friction force: place, drift, load."""
    factor = 1.0 + p.place_slope * x
    if p.drift_form == 0.0:
        factor += p.drift * grown(t, p.drift_time, 0.0)
    if p.place != 0.0:
        factor += p.place * wave(2.0 * math.pi * x / p.place_period + p.place_phase, p.place_wave)
    return max(factor, 0.0) + p.load_friction * load / p.level


@compiled
def film(p: Physics, x: float, v: float) -> float:
    """Return force per speed of everything that grows with speed, as a lubricant's film does."""
    c = p.viscous * (p.backward_viscous if v < 0.0 else 1.0)
    if p.place_damping != 0.0:
        c += p.place_damping * bell(x - p.place_damping_at, p.place_damping_width)
    return c + p.quadratic * abs(v)


@compiled
def softened(p: Physics, h: float, step: float, elements: Floats, bent: Floats) -> float:
    """Return what softening adds to the normalised friction `h` after a step (m).

    Form 1: each stop element's force k z by the factor 1 + softening (1 - |z| / reach), with `bent` their
    deflections (m); 2: all of it by 1 + softening (1 - h^4).
    """
    if p.softening_form == 2.0:
        return p.softening * h * (1.0 - h**4)
    more = 0.0
    for i in range(elements.shape[0]):
        stiffness, reach = elements[i, 0], elements[i, 1]
        bent[i] = max(-reach, min(reach, bent[i] + step))
        more += stiffness * bent[i] * (1.0 - abs(bent[i]) / reach)
    return p.softening * more / p.level
