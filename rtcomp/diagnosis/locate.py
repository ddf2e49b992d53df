"""Where: the residual force against every axis a person can point to, with significance that is honest.

Autocorrelation is respected by shifting the residual against the axis in a circle (whole strokes stay whole),
the number of axes looked at by counting the best of all of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.motion import Motion
from rtcomp.diagnosis.result import Place
from rtcomp.kernels import Floats

BINS = 24
SHIFTS = 199
LEAST_SHARE = 0.05
"""Part of the mismatch below which an axis is not mentioned."""


@dataclass(frozen=True)
class Axis:
    """Something the residual may depend on: a value (and for `odd` a sign) for every kept row."""

    name: str
    unit: str
    values: Floats
    odd: Floats | None = None
    """Sign of the direction of motion, where the dependence is looked for that changes sign with it."""


def axes_of(motion: Motion) -> list[Axis]:
    """Return position, speed, direction, command, acceleration, time, time and distance since reversal."""
    speed, push, since, way = [], [], [], []
    for s in motion.strips:
        v, a = np.zeros_like(s.position), np.zeros_like(s.position)
        v[1:-1] = (s.position[2:] - s.position[:-2]) / (2 * motion.period)
        a[1:-1] = (s.position[2:] - 2 * s.position[1:-1] + s.position[:-2]) / motion.period**2
        smooth = np.convolve(v, np.ones(9) / 9, mode="same")
        moving = np.where(np.abs(smooth) > 0.02 * np.abs(smooth).max(), np.sign(smooth), 0.0)
        t, d = _since_reversal(moving, s.position, motion.period)
        speed.append(v)
        push.append(a)
        since.append(t)
        way.append(d)
    v, a = motion.smooth(speed), motion.smooth(push)
    x = motion.plain([s.position for s in motion.strips])
    direction = np.sign(v)
    return [
        Axis("position", "m", x),
        Axis("position", "m", x, direction),
        Axis("speed", "m/s", v),
        Axis("direction", "1", direction),
        Axis("command", "V", motion.smooth([s.voltage for s in motion.strips])),
        Axis("acceleration", "m/s^2", a),
        Axis("time", "s", motion.plain([s.time for s in motion.strips])),
        Axis("time since reversal", "s", motion.plain(since)),
        Axis("distance since reversal", "m", motion.plain(way), direction),
        Axis("distance since reversal", "m", motion.plain(way)),
    ]


def _since_reversal(moving: Floats, position: Floats, period: float) -> tuple[Floats, Floats]:
    """Return time (s) and distance (m) since the direction of motion last changed, for every row."""
    last, at = 0.0, 0
    starts = np.empty(moving.size, dtype=np.int64)
    for k in range(moving.size):
        if moving[k] != 0.0 and moving[k] != last:
            last, at = moving[k], k
        starts[k] = at
    rows = np.arange(moving.size)
    way: Floats = np.abs(position - position[starts])
    return np.asarray((rows - starts) * period, dtype=np.float64), way


def locate(motion: Motion, before: Floats, after: Floats | None, seed: int = 0) -> list[Place]:
    """Return where the residual `before` (N, kept rows) shows, largest share first; `after` to compare."""
    random = np.random.default_rng(seed)
    shifts = random.integers(before.size // 20, before.size - before.size // 20, SHIFTS)
    looked = axes_of(motion)
    edges = [_edges(axis) for axis in looked]
    shares = np.array([_share(a, e, before) for a, e in zip(looked, edges, strict=True)])
    null = np.array(
        [[_share(a, e, np.roll(before, k)) for a, e in zip(looked, edges, strict=True)] for k in shifts]
    )
    # Axes differ in how much chance alone explains; the excess over that is compared between them.
    excess = (shares - null.mean(axis=0)) / (null.std(axis=0) + 1e-12)
    best = ((null - null.mean(axis=0)) / (null.std(axis=0) + 1e-12)).max(axis=1)
    found = []
    for axis, edge, share, z in zip(looked, edges, shares, excess, strict=True):
        p = (1.0 + float(np.count_nonzero(best >= z))) / (SHIFTS + 1.0)
        if share > LEAST_SHARE and p <= 0.05:
            found.append(_place(axis, edge, share, p, before, after))
    line = _line(motion, before, after)
    if line is not None:
        found.append(line)
    return sorted(found, key=lambda place: -place.share)


def _edges(axis: Axis) -> Floats:
    if axis.name == "direction":
        return np.array([-1.5, -0.5, 0.5, 1.5])
    edges = np.quantile(axis.values, np.linspace(0, 1, BINS + 1))
    return np.asarray(np.unique(edges))


def _means(axis: Axis, edges: Floats, residual: Floats) -> tuple[Floats, Floats, Floats]:
    """Return mean, count and standard error of the residual in every bin."""
    signed = residual if axis.odd is None else residual * axis.odd
    at = np.clip(np.searchsorted(edges, axis.values, side="right") - 1, 0, edges.size - 2)
    count = np.bincount(at, minlength=edges.size - 1).astype(np.float64)
    total = np.bincount(at, weights=signed, minlength=edges.size - 1)
    squares = np.bincount(at, weights=signed**2, minlength=edges.size - 1)
    mean = total / np.maximum(count, 1.0)
    spread = np.sqrt(
        np.maximum(squares / np.maximum(count, 1.0) - mean**2, 0.0) / np.maximum(count / 20.0, 1.0)
    )
    return mean, count, spread


def _share(axis: Axis, edges: Floats, residual: Floats) -> float:
    mean, count, _ = _means(axis, edges, residual)
    return float(np.sum(count * mean**2) / max(float(residual @ residual), 1e-300))


def _place(axis: Axis, edges: Floats, share: float, p: float, before: Floats, after: Floats | None) -> Place:
    mean, count, spread = _means(axis, edges, before)
    kept = count > 0
    centres = 0.5 * (edges[1:] + edges[:-1])
    if axis.name == "direction":
        centres = np.array([-1.0, 0.0, 1.0])
        kept &= centres != 0.0
    strong = np.flatnonzero(kept & (np.abs(mean) > 0.5 * np.abs(mean[kept]).max()))
    region = (float(edges[strong[0]]), float(edges[strong[-1] + 1]))
    later = None if after is None else _means(axis, edges, after)[0][kept]
    return Place(
        axis.name, axis.unit, region, share, p, _says(axis, region, share, mean, strong),
        centres[kept], mean[kept], later, spread[kept],
    )  # fmt: skip


def _says(axis: Axis, region: tuple[float, float], share: float, mean: Floats, strong: np.ndarray) -> str:
    part = f"{100 * share:.0f} % of the mismatch depends on {axis.name}"
    if axis.odd is not None:
        part += ", with the sign of the motion"
    if axis.name == "direction":
        return f"{part}: {mean[0]:+.3g} N backward, {mean[-1]:+.3g} N forward"
    if strong.size > 0.6 * mean.size:
        return f"{part}, all along"
    where = f"between {region[0]:.3g} and {region[1]:.3g} {axis.unit}"
    return f"{part}, most of it {where}"


def _line(motion: Motion, before: Floats, after: Floats | None) -> Place | None:
    """Return a line in the residual's spectrum, where one stands out."""
    rate = motion.rate / motion.thinning
    size = before.size
    window = np.hanning(size)
    power = np.abs(np.fft.rfft(before * window)) ** 2
    frequency = np.asarray(np.fft.rfftfreq(size, 1 / rate), dtype=np.float64)
    usable = (frequency > max(10 * rate / size, 1.0)) & (frequency < motion.cut)
    if not usable.any():
        return None
    around = np.convolve(power, np.ones(101) / 101, mode="same") + 1e-300
    at = int(np.argmax(np.where(usable, power / around, 0.0)))
    near = slice(max(at - 2, 0), at + 3)
    share = float(power[near].sum() / power.sum())
    if share < LEAST_SHARE or power[at] < 30 * np.median(power[max(at - 50, 0) : at + 51]):
        return None
    f = float(frequency[at])
    around_it = slice(max(at - 40, 0), at + 41)
    scale = 2.0 / window.sum()

    def part(residual: Floats) -> Floats:
        return np.asarray(scale * np.abs(np.fft.rfft(residual * window))[around_it], dtype=np.float64)

    return Place(
        "frequency", "Hz", (f * 0.99, f * 1.01), share, 0.005,
        f"{100 * share:.0f} % of the mismatch is a tone at {f:.4g} Hz, whatever the motion",
        frequency[around_it], part(before), None if after is None else part(after),
    )  # fmt: skip
