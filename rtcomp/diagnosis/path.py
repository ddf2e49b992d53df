"""The path behind a recording: what the sensor did undone, its derivatives, what a play leaves behind."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtcomp.diagnosis.motion import Motion, Strip
from rtcomp.kernels import Floats, call_effect, compiled
from rtcomp.physics import Effect, Place
from rtcomp.physics.rows import new_rows
from rtcomp.physics.wires import SENSED, STEP, TIME


def kinematics(strip: Strip, motion: Motion, effects: Sequence[Effect] = ()) -> tuple[Floats, Floats, Floats]:
    """Return true position, velocity and acceleration (SI) behind a strip, sensor effects undone."""
    x = true_position(effects, strip.time, strip.position, motion.averaged)
    return x, *derivatives(x, motion.period)


def derivatives(x: Floats, period: float) -> tuple[Floats, Floats]:
    """Return first and second central differences of positions (m) in rows of `period` (s)."""
    v, a = np.zeros_like(x), np.zeros_like(x)
    v[1:-1] = (x[2:] - x[:-2]) / (2 * period)
    a[1:-1] = (x[2:] - 2 * x[1:-1] + x[:-2]) / period**2
    return v, a


@compiled
def behind_play(x: Floats, gap: float, stiffness: Floats, reaches: Floats) -> Floats:
    """Return the position (m) of a load with friction that `x` drives through a play of +-`gap` (m).

    Slow motion: in contact the load goes along as long as its friction, of these elements, holds it
    against the end; where friction has relaxed it stays behind until the other end meets it.
    """
    out = np.empty_like(x)
    z = np.zeros_like(reaches)
    y, side = x[0], 0.0
    for k in range(x.size):
        if side == 0.0:
            if x[k] - y >= gap:
                side = 1.0
            elif x[k] - y <= -gap:
                side = -1.0
        if side != 0.0:
            move = x[k] - side * gap - y
            before = after = 0.0
            for i in range(z.size):
                before += stiffness[i] * z[i]
                after += stiffness[i] * min(max(z[i] + move, -reaches[i]), reaches[i])
            part = 1.0
            if after * side < 0.0:
                part = before / (before - after) if before != after else 0.0
                part = min(max(part, 0.0), 1.0)
            for i in range(z.size):
                z[i] = min(max(z[i] + part * move, -reaches[i]), reaches[i])
            y += part * move
            if part < 1.0:
                side = 0.0
        out[k] = y
    return out


def true_position(effects: Sequence[Effect], time: Floats, measured: Floats, averaged: int = 1) -> Floats:
    """Return the position (m) behind a measured one: the sensor effects undone, last first.

    Rows that are means over so many of the recording have a jump of the sensor within them.
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
        if averaged > 1 and effect.name == "sensor-jump":
            share = ((np.arange(averaged) + 0.5) / averaged - 0.5) * (time[1] - time[0])
            after = np.mean([time + s >= effect.values["time"] for s in share], axis=0)
            rows[:, SENSED] -= effect.values["size"] * after
            continue
        _undo(effect.inverse.address, p, state, rows)
    return np.ascontiguousarray(rows[:, SENSED])


@compiled
def _undo(address: int, p: Floats, state: Floats, rows: Floats) -> None:
    for k in range(rows.shape[0]):
        call_effect(address, p.ctypes.data, state.ctypes.data, rows[k].ctypes.data)
