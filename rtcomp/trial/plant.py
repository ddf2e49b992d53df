"""The trial's plant: an axis with everything that can be hidden in it, and its own controller and sensor.

    m a = drive - friction - spring - stop + cogging + weight + ...

Semi-implicit Euler in sub-steps of 10 to 40 us, damping taken implicitly; nothing in common with the
simulator that diagnoses are made with.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.trial.friction import AT, DEPTH, FROM, XI, advance

FAR = 1e9
"""A limit that is never met."""


class Physics(NamedTuple):
    """Every parameter of the plant, SI; the defaults leave an effect out."""

    mass: float
    force_constant: float
    voltage_limit: float
    viscous: float
    micro_damping: float
    micro_speed: float
    level: float
    reach: float
    shape: float
    skew: float = 0.0
    offset: float = 0.0
    deadband: float = 0.0
    saturation: float = FAR
    delay: float = 0.0
    lag: float = 0.0
    back_emf: float = 0.0
    ripple: float = 0.0
    ripple_period: float = 1.0
    ripple_phase: float = 0.0
    cogging: float = 0.0
    cogging_period: float = 1.0
    cogging_phase: float = 0.0
    cogging_second: float = 0.0
    spring: float = 0.0
    spring_cubic: float = 0.0
    weight: float = 0.0
    stop_position: float = FAR
    stop_stiffness: float = 0.0
    gap: float = 0.0
    second_mass: float = 0.0
    second_stiffness: float = 0.0
    second_damping: float = 0.0
    quadratic: float = 0.0
    backward_viscous: float = 1.0
    stribeck: float = 0.0
    stribeck_speed: float = 1.0
    place: float = 0.0
    place_period: float = 1.0
    place_phase: float = 0.0
    place_slope: float = 0.0
    load_friction: float = 0.0
    softening: float = 0.0
    friction_lag: float = 0.0
    ageing: float = 0.0
    ageing_distance: float = 1.0
    drift: float = 0.0
    drift_time: float = 1.0
    creep: float = 0.0
    creep_time: float = 1.0
    scale: float = 1.0
    sensor_delay: float = 0.0
    cyclic: float = 0.0
    cyclic_period: float = 1.0
    sensor_drift: float = 0.0
    sensor_drift_time: float = 1.0
    jump: float = 0.0
    jump_time: float = FAR
    tone: float = 0.0
    tone_frequency: float = 1.0
    tone_phase: float = 0.0
    bias: float = 0.0
    bump: float = 0.0
    bump_place: float = 0.0
    bump_width: float = 1.0
    speed_bump: float = 0.0
    speed_bump_at: float = 1.0
    speed_bump_width: float = 1.0
    place_damping: float = 0.0
    place_damping_at: float = 0.0
    place_damping_width: float = 1.0
    walk: float = 0.0
    gain_memory: float = 0.0
    gain_memory_width: float = 1.0
    hump: float = 0.0
    hump_distance: float = 1.0


class Loop(NamedTuple):
    """Controller and sensor: V/m, V/(m s), V s/m; Hz; m rms, m."""

    kp: float
    ki: float
    kd: float
    rate: float
    noise: float
    resolution: float


@dataclass(frozen=True)
class Run:
    """What a run leaves, each (K,): s, m, m, V; `truth` is the reading without noise and resolution (m)."""

    time: Floats
    reference: Floats
    position: Floats
    voltage: Floats
    truth: Floats


def simulate(physics: Physics, loop: Loop, reference: Floats, seed: int) -> Run:
    """Run the plant in closed loop along `reference` (m, (K,)); same seed, same run."""
    chance = np.random.default_rng(seed)
    noise = loop.noise * coloured(chance, reference.size)
    walk = _wander(chance, reference.size, loop.rate)
    parts = substeps(physics, loop.rate)
    out = np.empty((3, reference.size))
    _run(physics, loop, np.ascontiguousarray(reference, dtype=np.float64), noise, walk, parts, out)
    if not np.all(np.isfinite(out)):
        raise FloatingPointError("the trial's plant ran away")
    time = np.arange(reference.size) / loop.rate
    return Run(time, reference, out[0], out[1], out[2])


def substeps(physics: Physics, rate: float) -> int:
    """Return sub-steps a tick: at most 40 us, and an eighth of a radian of the stiffest contact."""
    light = physics.mass - physics.second_mass if physics.gap else physics.mass
    stiff = physics.level * physics.shape / physics.reach + physics.second_stiffness + physics.stop_stiffness
    step = min(4e-5, max(1e-5, 0.125 / math.sqrt(stiff / max(light, 1e-3))))
    return math.ceil(1.0 / (rate * step))


def coloured(chance: np.random.Generator, count: int) -> Floats:
    """Return noise of unit variance, (count,): nine tenths white, a tenth close to 1/f."""
    from scipy.signal import lfilter

    noise = math.sqrt(0.9) * chance.standard_normal(count)
    for keep in (0.9, 0.99, 0.999):
        part = lfilter([math.sqrt(1.0 - keep * keep)], [1.0, -keep], chance.standard_normal(count))
        noise += math.sqrt(0.1 / 3.0) * part
    return np.asarray(noise, dtype=np.float64)


def _wander(chance: np.random.Generator, count: int, rate: float) -> Floats:
    """Return a random walk of unit variance that forgets within some 8 s, (count,), as temperatures go."""
    from scipy.signal import lfilter

    keep = math.exp(-1.0 / (8.0 * rate))
    steps = math.sqrt(1.0 - keep * keep) * chance.standard_normal(count)
    steps[0] = chance.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -keep], steps), dtype=np.float64)


@compiled
def _bell(x: float, width: float) -> float:
    ratio = x / width
    return math.exp(-ratio * ratio)


@compiled
def _reading(p: Physics, t: float, x: float) -> float:
    """Return what the sensor says of `x` at `t`, without noise."""
    y = x / p.scale + p.cyclic * math.sin(2.0 * math.pi * x / p.cyclic_period)
    y += p.sensor_drift * (1.0 - math.exp(-t / p.sensor_drift_time))
    return y + (p.jump if t >= p.jump_time else 0.0)


@compiled
def _push(p: Physics, t: float, x: float) -> float:
    """Return the forces that friction and drive have no part in."""
    force = p.bias + p.weight - (p.spring + p.spring_cubic * x * x) * x
    depth = x - p.stop_position
    if (p.stop_position >= 0.0 and depth > 0.0) or (p.stop_position < 0.0 and depth < 0.0):
        force -= p.stop_stiffness * depth
    if p.tone != 0.0:
        force += p.tone * math.sin(2.0 * math.pi * p.tone_frequency * t + p.tone_phase)
    if p.cogging != 0.0:
        angle = 2.0 * math.pi * x / p.cogging_period + p.cogging_phase
        force += p.cogging * (math.sin(angle) + p.cogging_second * math.sin(2.0 * angle))
    if p.bump != 0.0:
        force += p.bump * _bell(x - p.bump_place, p.bump_width)
    return force


@compiled
def _gain(p: Physics, x: float, walk: float) -> float:
    """Return the force per volt here and now."""
    gain = p.force_constant * (1.0 + p.walk * walk)
    if p.ripple != 0.0:
        gain *= 1.0 + p.ripple * math.sin(2.0 * math.pi * x / p.ripple_period + p.ripple_phase)
    return gain


@compiled
def _volts(p: Physics, command: float) -> float:
    """Return what arrives of a command after offset, dead band and saturation."""
    u = command + p.offset
    if abs(u) <= p.deadband:
        return 0.0
    u -= math.copysign(p.deadband, u)
    return max(-p.saturation, min(p.saturation, u))


@compiled
def _slip_level(p: Physics, speed: float, rest: float) -> float:
    """Return the factor on the yield level: Stribeck's fall with speed, growth with the time of contact."""
    g = 1.0
    if p.stribeck != 0.0:
        g += p.stribeck * _bell(speed, p.stribeck_speed)
    if p.ageing != 0.0:
        g += p.ageing * math.log10(1.0 + rest / 0.01)
    return g


@compiled
def _scale(p: Physics, t: float, x: float, load: float) -> float:
    """Return the factor on the friction force: place, drift, load."""
    factor = 1.0 + p.place_slope * x + p.drift * (1.0 - math.exp(-t / p.drift_time))
    if p.place != 0.0:
        factor += p.place * math.sin(2.0 * math.pi * x / p.place_period + p.place_phase)
    return max(factor, 0.0) + p.load_friction * load / p.level


@compiled
def _film(p: Physics, x: float, v: float) -> float:
    """Return force per speed of everything that grows with speed, as a lubricant's film does."""
    c = p.viscous * (p.backward_viscous if v < 0.0 else 1.0)
    if p.place_damping != 0.0:
        c += p.place_damping * _bell(x - p.place_damping_at, p.place_damping_width)
    return c + p.quadratic * abs(v)


@compiled
def _run(
    p: Physics, loop: Loop, reference: Floats, noise: Floats, walk: Floats, parts: int, out: Floats
) -> None:
    """Write reading, command and noiseless reading, a row a tick, into `out` (3, K)."""
    tick = 1.0 / loop.rate
    step = tick / parts
    z = np.zeros(AT + 2 * DEPTH)
    commands = np.zeros(reference.size + 1)
    ago = p.sensor_delay / step
    past = np.zeros(int(ago) + 2)
    late = p.delay / step
    two = p.second_mass > 0.0
    mass = p.mass - p.second_mass
    x = v = x2 = v2 = h = crept = lagged_speed = lagged_volts = play = rest = integral = before = 0.0
    n = 0
    for k in range(reference.size):
        t = k * tick
        older = ago - int(ago)
        seen = (1.0 - older) * past[(n + 2) % past.size] + older * past[(n + 1) % past.size]
        out[2, k] = _reading(p, t, seen)
        measured = out[2, k] + noise[k]
        if loop.resolution > 0.0:
            measured = math.floor(measured / loop.resolution + 0.5) * loop.resolution
        error = reference[k] - measured
        u = loop.kp * error + loop.ki * (integral + error * tick)
        u += loop.kd * (error - before) * loop.rate if k > 0 else 0.0
        before = error
        if abs(u) < p.voltage_limit:
            integral += error * tick
        commands[k] = max(-p.voltage_limit, min(p.voltage_limit, u))
        out[0, k], out[1, k] = measured, commands[k]
        for j in range(parts):
            t = (k * parts + j) * step
            arrived = k * parts + j - late
            first = math.floor(arrived)
            part = arrived - first  # a command may arrive within a sub-step
            u = part * commands[(first + 1) // parts] if first >= -1 else 0.0
            u += (1.0 - part) * commands[first // parts] if first >= 0 else 0.0
            u = _volts(p, u)
            if p.lag > 0.0:
                lagged_volts += (u - lagged_volts) * (1.0 - math.exp(-step / p.lag))
                u = lagged_volts
            drive = _gain(p, x, walk[k]) * u
            if p.gain_memory != 0.0:
                play = max(u - p.gain_memory_width, min(u + p.gain_memory_width, play))
                drive += p.gain_memory * p.force_constant * (play - u)
            drive -= p.back_emf * v
            # Behind the play the load carries the friction; a mass on a spring does not.
            xf, vf = (x2, v2) if p.gap > 0.0 else (x, v)
            lagged_speed += (vf - lagged_speed) * (step / (p.friction_lag + step))
            speed = lagged_speed if p.friction_lag > 0.0 else vf
            level = p.level * _scale(p, t, xf, abs(drive))
            g = _slip_level(p, speed, rest)
            film = _film(p, xf, speed)
            # A film follows speed late; the contacts' own damping in presliding does not.
            force = level * g * h + film * (speed - vf)
            if p.speed_bump != 0.0:
                bell = _bell(abs(vf) - p.speed_bump_at, p.speed_bump_width)
                force += p.speed_bump * math.copysign(bell, vf)
            if p.hump != 0.0:
                ratio = abs(z[XI] - z[FROM]) / p.hump_distance
                force += p.hump * h * ratio * math.exp(1.0 - ratio)
            force = _push(p, t, xf) - force
            damping = film + p.micro_damping * _bell(vf, p.micro_speed)
            between = 0.0
            if two:
                apart = x - x2
                if p.gap > 0.0:
                    depth = max(apart - p.gap, 0.0) + min(apart + p.gap, 0.0)
                    if depth != 0.0:
                        between = p.second_stiffness * depth + p.second_damping * (v - v2)
                        if between * depth < 0.0:  # a contact does not pull
                            between = 0.0
                else:
                    between = p.second_stiffness * apart + p.second_damping * (v - v2)
            if p.gap > 0.0:
                v += step * (drive - between) / mass
                v2 = (v2 + step * (between + force) / p.second_mass) / (1.0 + step * damping / p.second_mass)
            else:
                v = (v + step * (drive + force - between) / mass) / (1.0 + step * damping / mass)
                if two:
                    v2 += step * between / p.second_mass
            x += step * v
            x2 += step * v2
            moved = step * (v2 if p.gap > 0.0 else v)
            if p.creep != 0.0:
                # A spring and a dashpot in series with the contact, whose own stiffness is at most this.
                yielded = p.creep * h * p.reach / p.shape
                slid = step * (yielded - crept) / (p.creep_time + step)
                crept += slid
                moved -= slid
            h = advance(
                z, moved / g, p.reach, p.shape * (1.0 + p.skew), p.shape * (1.0 - p.skew), p.softening
            )
            if p.ageing != 0.0:
                rest = (rest + step) / (1.0 + abs(moved) / p.ageing_distance)
            n += 1
            past[n % past.size] = x
