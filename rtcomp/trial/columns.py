"""What the rivals choose from: columns named after the catalogue, computed from a recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rtcomp.kernels import Floats
from rtcomp.trial.friction import stops_along

ROWS = 4000
"""Rows that a rival is given; a recording has more, which would only cost time."""


@dataclass(frozen=True)
class Columns:
    """What a rival is given, with everything that retuning takes up already taken out.

    The force to explain (N, (K,)), candidate columns (K, C), the effect that each stands for; and the
    believed parameters as they are and as retuned: name, from, to.
    """

    force: Floats
    columns: Floats
    names: tuple[str, ...]
    retuned: tuple[tuple[str, float, float], ...]


def columns_of(folder: Path) -> Columns:
    """Return the columns of the recording and stage in a case's folder."""
    from scipy.signal import butter, sosfiltfilt

    raw = np.loadtxt(folder / "train.csv.gz", delimiter=",", skiprows=1)
    content = yaml.safe_load((folder / "stage.yaml").read_text(encoding="utf-8"))
    stage: dict[str, Any] = content["stage"]
    # In open loop there is no reference between them.
    time, x, u = raw[:, 0], raw[:, -2], raw[:, -1]
    rate = float(content["rate"])
    sections = butter(3, min(100.0, 0.1 * rate), fs=rate, output="sos")

    def smooth(signal: Floats) -> Floats:
        return np.asarray(sosfiltfilt(sections, signal))

    slow = smooth(x)
    v = np.gradient(slow) * rate
    a = np.gradient(v) * rate
    u = 0.5 * (u + np.append(u[:1], u[:-1]))
    force = smooth(float(stage["force_constant"]) * u) - _known(stage, slow)
    speed, stroke = float(np.sqrt(np.mean(v**2))), float(np.max(np.abs(slow)))
    micro = float(stage.get("micro_damping_speed", 0.3 * speed))
    elements = np.array([[e["stiffness"], e["reach"]] for e in stage.get("friction", [])])
    # Where no friction is believed: one contact of a twentieth of the stroke, of no force.
    believes = elements.size > 0
    elements = elements if believes else np.array([[20.0 / stroke, 0.05 * stroke]])
    level = float(elements[:, 0] @ elements[:, 1])
    h = stops_along(x, elements[:, 0] / level, elements[:, 1].copy()).sum(axis=1)
    further = stops_along(x, elements[:, 0] / (1.05 * level), 1.05 * elements[:, 1]).sum(axis=1)
    slowly = np.exp(-((v / micro) ** 2)) * v
    base = np.column_stack([smooth(c) for c in (a, v, h, slowly, further - h)])
    found = [stage["mass"], stage.get("viscous", 0.0), level * believes, stage.get("micro_damping", 0.0), 0.0]
    believed = np.array(found)
    mismatch = force - base @ believed
    items: list[tuple[str, Floats]] = [
        ("constant-force", np.ones_like(v)),
        ("parallel-spring", slow), ("parallel-spring", slow**3),
        ("quadratic-drag", np.abs(v) * v), ("asymmetric-viscous-friction", np.abs(v)),
        ("asymmetric-friction", 1.0 - h**2), ("load-dependent-friction", np.abs(force) * h),
        ("drive-deadband", np.tanh(u / (0.05 * np.max(np.abs(u))))),
        ("drive-delay", np.gradient(force) * rate),
        ("drive-saturation", np.sign(u) * np.maximum(np.abs(u) - np.quantile(np.abs(u), 0.95), 0.0)),
        ("position-dependent-friction", h * slow),
        ("friction-drift", h * time), ("sensor-drift", time),
        ("end-stop", np.maximum(slow - 0.5 * stroke, 0.0)),
        ("end-stop", np.minimum(slow + 0.5 * stroke, 0.0)),
    ]  # fmt: skip
    items += [("stribeck", h * np.exp(-((v / (f * speed)) ** 2))) for f in (0.1, 0.3)]
    rest = mismatch - base @ np.linalg.lstsq(base, mismatch, rcond=1e-8)[0]
    turn = 2.0 * np.pi * slow / _period(slow, rest)
    even = 2.0 * np.pi * slow / _period(slow, rest * np.sign(v))
    for wave in (np.sin, np.cos):
        items.append(("cogging", wave(turn)))
        items.append(("torque-ripple", force * wave(turn)))
        items.append(("position-dependent-friction", h * wave(even)))
        items.append(("tonal-disturbance", wave(2.0 * np.pi * _frequency(rest, rate) * time)))
    edge = int(0.3 * rate)
    keep = np.linspace(edge, x.size - edge - 1, min(ROWS, x.size - 2 * edge)).astype(int)
    given = base[keep] / np.sqrt(np.mean(base[keep] ** 2, axis=0))
    columns = np.column_stack([smooth(c)[keep] for _, c in items])
    whole = np.sqrt(np.mean(columns**2, axis=0))
    columns -= given @ np.linalg.lstsq(given, columns, rcond=1e-8)[0]
    alone = np.sqrt(np.mean(columns**2, axis=0))
    # Of what retuning takes up almost wholly, only rounding would be left to choose.
    kept = np.flatnonzero(alone > 0.02 * whole)
    columns = columns[:, kept] / alone[kept]
    left = mismatch[keep] - given @ np.linalg.lstsq(given, mismatch[keep], rcond=1e-8)[0]
    better = believed + np.linalg.lstsq(base[keep], mismatch[keep], rcond=1e-12)[0]
    keys = ("mass", "viscous", "friction.level", "micro_damping")
    moved = tuple((key, float(believed[i]), float(better[i])) for i, key in enumerate(keys))
    return Columns(left, columns, tuple(items[int(i)][0] for i in kept), moved)


def _known(stage: dict[str, Any], x: Floats) -> Floats:
    """Return the force (N, (K,)) of a spring and a weight that are believed, signed as friction is."""
    force = np.zeros(x.size)
    for entry in stage.get("effects", []):
        if entry["name"] == "parallel-spring":
            force += entry["stiffness"] * x
        elif entry["name"] == "gravity":
            force -= entry["amplitude"] * np.sin(x + entry["phase"])
    return force


def _period(x: Floats, rest: Floats) -> float:
    """Return the period in position (m) at which `rest` is strongest."""
    stroke = float(x.max() - x.min())
    counts = np.arange(1.0, 60.0, 0.25)
    some = slice(None, None, max(1, x.size // 5000))
    waves = np.exp(-2j * np.pi * np.outer(counts / stroke, x[some]))
    return float(stroke / counts[np.argmax(np.abs(waves @ rest[some]))])


def _frequency(rest: Floats, rate: float) -> float:
    """Return the frequency (Hz) above 2 Hz at which `rest` is strongest."""
    spectrum = np.abs(np.fft.rfft(rest * np.hanning(rest.size)))
    at = np.fft.rfftfreq(rest.size, 1.0 / rate)
    spectrum[at < 2.0] = 0.0
    return float(at[np.argmax(spectrum)])
