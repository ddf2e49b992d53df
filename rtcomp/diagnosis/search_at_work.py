"""Entries tried at work, at a few sizes: what changes drive, friction, motion or sensor.

Sizes come from the recording at hand: its commands, speeds, times, its noise, and the friction already found.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rtcomp.diagnosis.periodogram import highest, periodogram
from rtcomp.diagnosis.scene import Entry, Point, Scene

FOLLOWED = {"following": 1.0, "stiffening": 0.5}
"""Entries that what sticks follows: how much stiffer it becomes begins far from both ends, to be refined."""
RING_S = 2.0
"""s of a stretch that a ringing is looked for in."""
SLOW = 0.5
"""Part of the bandwidth up to which a wave of the reading is taken to be seen as it is."""
LEAST_WAVES, MOST_WAVES = 3.0, 400.0
"""Waves along the stroke, from and to which an error of the reading is looked for."""
SAME = 0.03
"""Relative distance of periods that are one."""


def at_work(scene: Scene) -> Iterator[Point]:
    """Go through every entry worth trying at work on this recording."""
    for make in (_drive, _speed_dependent, _presliding, _inertial, _sensing):
        yield from make(scene)


def _drive(s: Scene) -> list[Point]:
    largest, typical = float(np.abs(s.volts).max()), float(np.sqrt(np.mean(s.volts**2)))
    period = s.motion.period
    points = [{"name": "drive-deadband", "width": w * typical} for w in (0.03, 0.1, 0.25, 0.5)]
    points += [{"name": "drive-saturation", "limit": w * largest} for w in (0.45, 0.6, 0.75, 0.88)]
    points += [{"name": "drive-gain", "gain": g} for g in (0.7, 0.85, 1.15, 1.4)]
    for n in (0.5, 1.0, 2.0, 4.0, 8.0):
        points += [
            {"name": "drive-delay", "delay": n * period},
            {"name": "drive-lag", "time_constant": n * period},
        ]
        points += [{"name": "sensor-delay", "delay": n * period}]
    return [Point(p) for p in points]


def _speed_dependent(s: Scene) -> list[Point]:
    points: list[Entry] = [
        {"name": "stribeck", "rise": rise, "velocity": float(v)} for v in s.speeds(5) for rise in (0.15, 0.5)
    ]
    points += [{"name": "frictional-lag", "time_constant": t} for t in (2e-3, 1e-2, 5e-2, 0.2)]
    return [Point(p) for p in _both_ways(points)]


def _both_ways(points: list[Entry]) -> list[Entry]:
    """Return the entries, and each once more with what sticks following the level, its stiffness refined."""
    return [*points, *({**p, **FOLLOWED} for p in points)]


def _presliding(s: Scene) -> list[Point]:
    reach = float(s.fitted.ledger.reaches.max())
    points: list[Entry] = [
        {"name": "asymmetric-friction", "asymmetry": a, **kind}
        for kind in ({}, {"closing": 1.0})
        for a in (-0.45, -0.2, -0.05, 0.05, 0.2, 0.45)
    ]
    points += [{"name": "non-congruent-friction", "softening": a} for a in (0.05, 0.2, 0.5)]
    points += _both_ways(
        [
            *({"name": "load-dependent-friction", "coefficient": a} for a in (0.03, 0.08, 0.2)),
            *(
                {"name": "stiction-ageing", "growth": g, "distance": d * reach, "onset": t}
                for g in (0.05, 0.2)
                for d in (0.1, 1.0)
                for t in (0.01, 0.1)
            ),
        ]
    )
    points += [
        {"name": "creep", "fraction": f, "time_constant": t} for f in (0.05, 0.2) for t in (0.03, 0.3, 3.0)
    ]
    for g in (0.002, 0.01, 0.025, 0.07, 0.2, 0.6, 1.5):
        play: Entry = {"name": "backlash", "gap": g * reach}
        points += [play, *({**play, "share": 0.45, "contact": hz} for hz in _contacts(s, 0.45))]
    return [Point(p) for p in points]


def _contacts(s: Scene, share: float) -> list[float]:
    """Return frequencies (Hz) of a load on contacts two and eight times as stiff as its friction."""
    ledger = s.fitted.ledger
    stiffness = float(ledger.weights.sum())
    return [float(np.sqrt(n * stiffness / (share * ledger.stage.mass)) / (2 * np.pi)) for n in (2.0, 8.0)]


def _inertial(s: Scene) -> list[Point]:
    mass = s.fitted.ledger.stage.mass
    points: list[Entry] = [{"name": "inertia", "mass": mass * f} for f in (0.5, 0.75, 0.87, 1.15, 1.3, 1.8)]
    for f in np.geomspace(4.0, 1.5 * s.motion.cut, 9):
        points += [
            {"name": "resonance", "frequency": float(f), "damping": z, "mass_ratio": r}
            for z in (0.03, 0.15)
            for r in (0.1, 0.5)
        ]
    for f in _ringing(s):
        points += [
            {"name": "resonance", "frequency": f, "damping": z, "mass_ratio": r}
            for z in (0.03, 0.1)
            for r in (0.02, 0.1)
        ]
    return [Point(p) for p in points]


def _ringing(s: Scene, peaks: int = 2) -> list[float]:
    """Return frequencies (Hz) at which the residual rings most: a small mass is seen only near its own.

    The averaged spectrum of stretches as long as RING_S, so that a ringing which comes and goes is one peak.
    """
    rate = s.motion.rate / s.motion.thinning
    size = int(RING_S * rate)
    stretches = [s.residual[i : i + size] for i in range(0, s.residual.size - size + 1, max(size // 2, 1))]
    if size < 16 or not stretches:
        return []
    power = np.mean(np.abs(np.fft.rfft(np.array(stretches) * np.hanning(size))) ** 2, axis=0)
    frequency = np.fft.rfftfreq(size, 1 / rate)
    power[(frequency < 2.0 / RING_S) | (frequency > 1.2 * s.motion.cut)] = 0.0
    found = []
    for _ in range(peaks):
        at = float(frequency[int(np.argmax(power))])
        found.append(at)
        power[(frequency > at / 1.3) & (frequency < 1.3 * at)] = 0.0
    return [f for f in found if f > 0.0]


def _sensing(s: Scene) -> list[Point]:
    points: list[Entry] = [{"name": "sensor-scale", "scale": f} for f in (0.77, 0.88, 1.14, 1.3)]
    for period in _cyclic_periods(s):
        amplitude, phase = _cyclic_size(s, period)
        points += [
            {
                "name": "sensor-periodic-error",
                "amplitude": a * amplitude,
                "period": period,
                "phase": phase + p,
            }
            for a, p in ((1.0, 0.0), (0.5, 0.0), (2.0, 0.0), (1.0, 1.57), (1.0, 3.14), (1.0, -1.57))
        ]
    reach = float(s.fitted.ledger.reaches[0])
    total = float(s.time.max())
    points += [
        {"name": "sensor-drift", "drift": d * reach, "time_constant": t * total}
        for d in (-100.0, -15.0, -2.0, 2.0, 15.0, 100.0)
        for t in (0.03, 0.15, 0.6)
    ]
    points += [{"name": "sensor-jump", "size": d, "time": t} for t, d in s.motion.jumps]
    points += [
        {"name": "sensor-jump", "size": d * reach, "time": t}
        for t in _steps(s)
        for d in (-2.0, -0.3, 0.3, 2.0)
    ]
    return [Point(p) for p in points]


def _cyclic_periods(s: Scene, peaks: int = 2) -> list[float]:
    """Return periods (m) whose apparent acceleration stands out of the residual.

    Of all rows, and for each octave of periods of those slow enough that the wave is within the comparison's
    bandwidth: where half of a motion is too fast for a period, the other half still shows it.
    """
    weight = s.fitted.ledger.stage.mass * s.v**2
    speed = np.abs(s.v)
    step = float(np.quantile(np.abs(np.diff(s.x)), 0.5)) or s.span / 1000
    found: list[float] = []
    most = min(MOST_WAVES, s.span / (3 * step))
    if most > LEAST_WAVES:
        n, power = periodogram(s.x, s.span, weight, s.residual, most)
        found += highest(n, np.where(n < LEAST_WAVES, 0.0, power), peaks, SAME)
    waves, powers = [], []
    for low in LEAST_WAVES * 2.0 ** np.arange(np.log2(MOST_WAVES / LEAST_WAVES)):
        slow = speed < s.motion.cut * s.span / (np.sqrt(2.0) * low)
        n, power = periodogram(s.x, s.span, np.where(slow, weight, 0.0), s.residual, 2.0 * low)
        waves.append(n[n >= low])
        powers.append(power[n >= low])
    others = highest(np.concatenate(waves), np.concatenate(powers), peaks, SAME)
    found += [n for n in others if all(abs(np.log(n / known)) > SAME for known in found)]
    return [s.span / n for n in found]


def _cyclic_size(s: Scene, period: float) -> tuple[float, float]:
    """Return amplitude (m) and phase of the error whose apparent acceleration explains most of the residual.

    A reading x + A sin(k x + phase) accelerates by -A k^2 v^2 sin(k x + phase) where it is fast; where so
    fast that the wave leaves the comparison's bandwidth, nothing is seen of it.
    """
    k = 2 * np.pi / period
    weight = s.fitted.ledger.stage.mass * (k * s.v) ** 2
    seen = k * np.abs(s.v) < 2 * np.pi * SLOW * s.motion.cut
    waves = np.column_stack([weight * np.sin(k * s.x), weight * np.cos(k * s.x)])[seen]
    size, *_ = np.linalg.lstsq(waves, s.residual[seen], rcond=None)
    most = 0.3 / k  # beyond 1 / k the reading would run backwards
    return min(max(float(np.hypot(*size)), 1e-12), most), float(np.arctan2(size[1], size[0]))


def _steps(s: Scene, count: int = 3) -> list[float]:
    """Return times (s) at which the residual most suddenly changes its level."""
    width = max(4, s.residual.size // 60)
    mean = np.convolve(s.residual, np.ones(width) / width, mode="valid")
    change = np.abs(mean[width:] - mean[:-width])
    found = []
    for _ in range(count):
        at = int(np.argmax(change))
        found.append(float(s.time[at + width]))
        change[max(at - width, 0) : at + width] = 0.0
    return found
