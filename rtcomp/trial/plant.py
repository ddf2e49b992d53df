"""The trial's plant: an axis with everything that can be hidden in it, and its own controller and sensor.

    m a = drive - friction - spring - stop + cogging + weight + ...

Leapfrog in sub-steps of 5 to 20 us, damping by Crank and Nicolson; nothing in common with the
simulator that diagnoses are made with.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.trial.axis import FAR, Loop, Physics
from rtcomp.trial.forces import bell, film, gain, push, reading, scale, slip_level, softened, volts
from rtcomp.trial.friction import AT, DEPTH, ELEMENTS, FROM, XI, advance, stop_elements

__all__ = ["FAR", "Loop", "Physics", "Run", "coloured", "simulate", "substeps"]


@dataclass(frozen=True)
class Run:
    """What a run leaves, each (K,): s, m, m, V; `truth` is the reading without noise and resolution (m)."""

    time: Floats
    reference: Floats
    position: Floats
    voltage: Floats
    truth: Floats


def simulate(physics: Physics, loop: Loop, reference: Floats, seed: int) -> Run:
    """Run the plant in closed loop along `reference` (m, (K,)); same seed, same run.

    Where the loop is open, `reference` is the command (V).
    """
    chance = np.random.default_rng(seed)
    noise = loop.noise * coloured(chance, reference.size)
    walk = _wander(chance, reference.size, loop.rate)
    parts = substeps(physics, loop.rate)
    out = np.empty((3, reference.size))
    elements = np.array(stop_elements(physics.level, physics.reach, physics.shape, ELEMENTS))
    asked = np.ascontiguousarray(reference, dtype=np.float64)
    _run(physics, loop, asked, noise, walk, elements, parts, out)
    if not np.all(np.isfinite(out)):
        raise FloatingPointError("the trial's plant ran away")
    time = np.arange(reference.size) / loop.rate
    return Run(time, reference, out[0], out[1], out[2])


def substeps(physics: Physics, rate: float) -> int:
    """Return sub-steps a tick: at most 20 us, and a sixteenth of a radian of the stiffest contact."""
    light = physics.mass - physics.second_mass if physics.gap else physics.mass
    stiff = physics.level * physics.shape / physics.reach + physics.second_stiffness + physics.stop_stiffness
    step = min(2e-5, max(5e-6, 0.0625 / math.sqrt(stiff / max(light, 1e-3))))
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
def damped_by(v: float, damping: float, force: float, mass: float, step: float) -> float:
    """Return a velocity (m/s) a step (s) later, damped by that half-way (Crank and Nicolson 1947)."""
    half = 0.5 * step * damping / mass
    return ((1.0 - half) * v + step * force / mass) / (1.0 + half)


@compiled
def _run(
    p: Physics, loop: Loop, reference: Floats, noise: Floats, walk: Floats, elements: Floats, parts: int,
    out: Floats,
) -> None:  # fmt: skip
    """Write reading, command and noiseless reading, a row a tick, into `out` (3, K)."""
    tick = 1.0 / loop.rate
    step = tick / parts
    z = np.zeros(AT + 2 * DEPTH)
    bent = np.zeros(elements.shape[0])
    softer = 0.0
    commands = np.zeros(reference.size + 1)
    ago = p.sensor_delay / step
    past = np.zeros(int(ago) + 2)
    # Leapfrog: the velocity is that of half a sub-step ago, and so are the commands that act on it.
    late = p.delay / step + 0.5
    two = p.second_mass > 0.0
    mass = p.mass - p.second_mass
    x = v = x2 = v2 = h = crept = lagged_speed = lagged_volts = play = rest = integral = before = 0.0
    n = 0
    for k in range(reference.size):
        t = k * tick
        older = ago - int(ago)
        seen = (1.0 - older) * past[(n + 2) % past.size] + older * past[(n + 1) % past.size]
        out[2, k] = reading(p, t, seen)
        measured = out[2, k] + noise[k]
        if loop.resolution > 0.0:
            measured = math.floor(measured / loop.resolution + 0.5) * loop.resolution
        error = reference[k] - measured
        u = loop.kp * error + loop.ki * (integral + error * tick)
        u += loop.kd * (error - before) * loop.rate if k > 0 else 0.0
        before = error
        if loop.open != 0.0:
            u = reference[k]
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
            u = volts(p, u)
            if p.lag > 0.0:
                ahead = lagged_volts + (u - lagged_volts) * (1.0 - math.exp(-step / p.lag))
                lagged_volts, u = ahead, 0.5 * (lagged_volts + ahead)
            drive = gain(p, x, walk[k]) * u
            if p.gain_memory != 0.0:
                play = max(u - p.gain_memory_width, min(u + p.gain_memory_width, play))
                drive += p.gain_memory * p.force_constant * (play - u)
            # Behind the play the load carries the friction; a mass on a spring does not.
            xf, vf = (x2, v2) if p.gap > 0.0 else (x, v)
            lagged_speed += (vf - lagged_speed) * (step / (p.friction_lag + step))
            speed = lagged_speed if p.friction_lag > 0.0 else vf
            level = p.level * scale(p, t, xf, abs(drive - p.back_emf * v))
            g = slip_level(p, t, speed, rest)
            damped = film(p, xf, speed)
            # A film follows speed late; the contacts' own damping in presliding does not.
            force = level * g * (h + softer) + damped * (speed - vf)
            if p.speed_bump != 0.0:
                around = bell(abs(vf) - p.speed_bump_at, p.speed_bump_width)
                force += p.speed_bump * math.copysign(around, vf)
            if p.hump != 0.0:
                ratio = abs(z[XI] - z[FROM]) / p.hump_distance
                force += p.hump * h * ratio * math.exp(1.0 - ratio)
            force = push(p, t, xf) - force
            damping = damped + p.micro_damping * bell(vf, p.micro_speed)
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
                v = damped_by(v, p.back_emf, drive - between, mass, step)
                v2 = damped_by(v2, damping, between + force, p.second_mass, step)
            else:
                v = damped_by(v, damping + p.back_emf, drive + force - between, mass, step)
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
            reversing = p.softening if p.softening_form == 0.0 else 0.0
            up, down = p.shape * (1.0 + p.skew), p.shape * (1.0 - p.skew)
            h = advance(z, moved / g, p.reach, up, down, reversing)
            if p.softening_form != 0.0:
                softer = softened(p, h, moved / g, elements, bent)
            if p.ageing != 0.0:
                rest = (rest + step) / (1.0 + abs(moved) / p.ageing_distance)
            n += 1
            past[n % past.size] = x
