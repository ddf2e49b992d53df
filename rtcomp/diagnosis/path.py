"""The path behind a recording: what the sensor did undone, its derivatives, what a play leaves behind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.motion import Motion, Strip
from rtcomp.kernels import Floats, call_effect, compiled
from rtcomp.physics import Effect, Place
from rtcomp.physics.coupled import contact
from rtcomp.physics.rows import new_rows
from rtcomp.physics.wires import SENSED, STEP, TIME
from rtcomp.stage.lowpass import zero_phase

FINE = 0.3
"""Longest sub-step (rad) of the load's oscillation behind a play."""


def kinematics(strip: Strip, motion: Motion, effects: Sequence[Effect] = ()) -> tuple[Floats, Floats, Floats]:
    """Return true position, velocity and acceleration (SI) behind a strip, sensor effects undone."""
    x = true_position(effects, strip.time, strip.position, motion.averaged, motion.smoothed)
    return x, *derivatives(x, motion.period)


def derivatives(x: Floats, period: float) -> tuple[Floats, Floats]:
    """Return first and second central differences of positions (m) in rows of `period` (s)."""
    v, a = np.zeros_like(x), np.zeros_like(x)
    v[1:-1] = (x[2:] - x[:-2]) / (2 * period)
    a[1:-1] = (x[2:] - 2 * x[1:-1] + x[:-2]) / period**2
    return v, a


@dataclass(frozen=True)
class Load:
    """What is behind a play: its friction and inertia, and how it meets the ends."""

    mass: float
    viscous: float
    micro_damping: float
    micro_speed: float
    stiffness: Floats
    """(n,) N/m of stop elements, with `reaches` (n,) m."""
    reaches: Floats


def behind_play(x: Floats, period: float, gap: float, contact_hz: float, load: Load) -> Floats:
    """Return the position (m) of a load that `x` (m, rows of `period` s) drives through a play of +-`gap`.

    The load's equation of motion, in sub-steps of its fastest oscillation: friction against the contact of
    either end, which gives way and does not pull. Where neither end holds it, it stays, or flies on.
    """
    omega = 2.0 * math.pi * contact_hz
    held = math.sqrt(omega**2 + float(np.sum(load.stiffness)) / load.mass)
    parts = max(1, math.ceil(period * held / FINE))
    return _drawn(
        x, period / parts, parts, gap, omega, load.mass, load.viscous, load.micro_damping, load.micro_speed,
        load.stiffness, load.reaches,
    )  # fmt: skip


@compiled
def _drawn(
    x: Floats, h: float, parts: int, gap: float, omega: float, mass: float, viscous: float, micro: float,
    micro_speed: float, stiffness: Floats, reaches: Floats,
) -> Floats:  # fmt: skip
    out = np.empty_like(x)
    z = np.zeros_like(reaches)
    y, u = x[0], 0.0
    out[0] = y
    for k in range(1, x.size):
        base = (x[k] - x[k - 1]) / (h * parts)
        for j in range(parts):
            at = x[k - 1] + base * j * h  # where the load is, too: speeds are half a step on
            friction = 0.0
            for i in range(z.size):
                friction += stiffness[i] * z[i]
            ratio = u / micro_speed
            damping = viscous + micro * math.exp(-ratio * ratio)
            u += h * (contact(y - at, u - base, gap, omega) - friction / mass)
            u /= 1.0 + h * damping / mass
            for i in range(z.size):
                z[i] = min(max(z[i] + h * u, -reaches[i]), reaches[i])
            y += h * u
        out[k] = y
    return out


def true_position(
    effects: Sequence[Effect], time: Floats, measured: Floats, averaged: int = 1, smoothed: float = 0.0
) -> Floats:
    """Return the position (m) behind a measured one: the sensor effects undone, last first.

    In rows that are means over so many of the recording, which was smoothed from so many Hz on (0: was not),
    a jump of the sensor is no step either.
    """
    sensors = sorted((e for e in effects if e.place is Place.SENSOR), key=lambda e: -e.order)
    if not sensors:
        return measured
    rows = new_rows(measured.size)
    rows[:, TIME], rows[:, SENSED] = time, measured
    rows[:, STEP] = np.gradient(time)
    for effect in sensors:
        if effect.inverse is None:
            from scipy.interpolate import CubicSpline

            late = float(effect.values.get("delay", 0.0))
            rows[:, SENSED] = CubicSpline(time, rows[:, SENSED])(np.minimum(time + late, time[-1]))
            continue
        p, state = np.append(effect.vector(), 0.0), np.append(effect.initial_state(), 0.0)
        if effect.name == "sensor-jump" and (averaged > 1 or smoothed > 0.0):
            rows[:, SENSED] -= effect.values["size"] * _after(effect.values["time"], time, averaged, smoothed)
            continue
        _undo(effect.inverse.address, p, state, rows)
    return np.ascontiguousarray(rows[:, SENSED])


def _after(moment: float, time: Floats, averaged: int, smoothed: float) -> Floats:
    """Return what became of a step at `moment` (s) from 0 to 1 on its way to the rows at `time` (s, (K,))."""
    period = float(time[1] - time[0])
    share = ((np.arange(averaged) + 0.5) / averaged - 0.5) * period
    after = (time[:, np.newaxis] + share >= moment).astype(np.float64).ravel()
    if smoothed > 0.0:
        after = zero_phase(after, smoothed, averaged / period)
    return np.asarray(after.reshape(-1, averaged).mean(axis=1))


@compiled
def _undo(address: int, p: Floats, state: Floats, rows: Floats) -> None:
    for k in range(rows.shape[0]):
        call_effect(address, p.ctypes.data, state.ctypes.data, rows[k].ctypes.data)
