"""Where to look for each entry of the catalogue: the points of its parameters from which a search starts.

An entry that acts as a force of free size is tried as a column of the ledger (`Column`); one that changes
friction, drive, sensor or motion is tried at work, at a few sizes (`Point`). All sizes come from the
recording at hand: its stroke, speeds, commands, times, and the friction already found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.diagnosis.base import FIXED, Fitted
from rtcomp.diagnosis.motion import Motion
from rtcomp.kernels import Floats
from rtcomp.physics import Effect, build, catalogue

Entry = dict[str, object]


@dataclass(frozen=True)
class Column:
    """A force tried as columns of free size; `compose` makes the entry from the sizes found."""

    name: str
    columns: Callable[[], list[Floats]]
    compose: Callable[[Floats], Entry]


@dataclass(frozen=True)
class Point:
    """An entry tried at work, as it stands."""

    entry: Entry

    @property
    def name(self) -> str:
        """The entry's name."""
        return str(self.entry["name"])


@dataclass(frozen=True)
class Scene:
    """What the recording offers: rows for columns, and the scales that searches start from."""

    motion: Motion
    fitted: Fitted
    x: Floats
    v: Floats
    time: Floats
    volts: Floats
    residual: Floats

    @classmethod
    def of(cls, motion: Motion, fitted: Fitted) -> Scene:
        """Gather the rows that were kept."""
        velocity = []
        for s in motion.strips:
            v = np.zeros_like(s.position)
            v[1:-1] = (s.position[2:] - s.position[:-2]) / (2 * motion.period)
            velocity.append(v)
        return cls(
            motion,
            fitted,
            motion.plain([s.position for s in motion.strips]),
            motion.smooth(velocity),
            motion.plain([s.time for s in motion.strips]),
            motion.smooth([s.voltage for s in motion.strips]),
            fitted.residual,
        )

    @property
    def span(self) -> float:
        """Length of the stroke (m)."""
        low, high = self.motion.stroke
        return high - low

    @property
    def level(self) -> float:
        """Friction with everything sliding (N)."""
        rows = slice(FIXED, FIXED + self.fitted.ledger.reaches.size)
        return float(np.sum(self.fitted.coefficients[rows] * self.fitted.ledger.reaches))

    @property
    def force_constant(self) -> float:
        """N/V."""
        return self.fitted.ledger.stage.force_constant

    def speeds(self, count: int) -> Floats:
        """Return speeds (m/s) spread over those of the motion."""
        moving = np.abs(self.v[np.abs(self.v) > 0])
        return np.asarray(np.quantile(moving, np.linspace(0.1, 0.85, count)))


def searches(scene: Scene) -> Iterator[Column | Point]:
    """Go through everything worth trying on this recording, entry by entry."""
    for make in (
        _constant, _by_speed, _spring, _cogging, _ripple, _friction_along, _tone, _drift_of_level, _end_stop,
        _any_shape,
        _drive, _speed_dependent, _presliding, _inertial, _sensing,
    ):  # fmt: skip
        for search in make(scene):
            if isinstance(search, Column) or _known(search.entry):
                yield search


def _known(entry: Entry) -> bool:
    try:
        catalogue.entry(str(entry["name"]))
    except ValueError:
        return False
    return True


def effect_of(entry: Entry) -> Effect:
    """Build the effect of an entry."""
    return build(entry)


def _constant(s: Scene) -> list[Column]:
    one = -np.ones_like(s.x)
    return [
        Column(
            "drive-offset",
            lambda: [one],
            lambda c: {"name": "drive-offset", "offset": c[0] / s.force_constant},
        )
    ]


def _by_speed(s: Scene) -> list[Column]:
    viscous = max(s.fitted.ledger.stage.mechanics.viscous, 1e-12)
    return [
        Column(
            "viscous-friction", lambda: [s.v], lambda c: {"name": "viscous-friction", "coefficient": c[0]}
        ),
        Column(
            "quadratic-drag",
            lambda: [np.abs(s.v) * s.v],
            lambda c: {"name": "quadratic-drag", "coefficient": c[0]},
        ),
        Column(
            "asymmetric-viscous-friction",
            lambda: [np.abs(s.v)],
            lambda c: {
                "name": "asymmetric-viscous-friction",
                "ratio": float(np.clip(c[0] / viscous, -50, 50)),
            },
        ),
    ]


def _spring(s: Scene) -> list[Column]:
    scale = s.span / 2
    return [
        Column(
            "parallel-spring",
            lambda: [s.x, (s.x / scale) ** 3],
            lambda c: {"name": "parallel-spring", "stiffness": c[0], "cubic": c[1] / scale**3},
        )
    ]


def _waves(c: Floats) -> tuple[float, float]:
    """Return amplitude and phase of c0 sin + c1 cos."""
    return float(np.hypot(c[0], c[1])), float(np.arctan2(c[1], c[0]))


def _periodic(
    s: Scene, name: str, weight: Floats, sign: float, entry: Callable[[Floats, float], Entry]
) -> list[Column]:
    def column(period: float) -> Column:
        k = 2 * np.pi / period

        def columns() -> list[Floats]:
            return [sign * weight * np.sin(k * s.x), sign * weight * np.cos(k * s.x)]

        return Column(name, columns, lambda c: entry(c, period))

    return [column(p) for p in _periods(s, weight)]


def _periods(s: Scene, weight: Floats, peaks: int = 4) -> list[float]:
    """Return periods (m) worth trying: the longest ones, and those that stand out of the residual."""
    found = [s.span / n for n in (1.0, 1.3, 1.7, 2.2, 2.8)]
    step = float(np.median(np.abs(np.diff(s.x)))) or s.span / 1000
    most = min(150.0, s.span / (6 * step))
    n = np.arange(2.5, max(most, 3.0), 0.2)
    power = np.zeros(n.size)
    for i in range(0, n.size, 64):
        angle = 2 * np.pi * np.outer(n[i : i + 64], s.x / s.span)
        for wave in (np.sin(angle), np.cos(angle)):
            wave *= weight
            power[i : i + 64] += (wave @ s.residual) ** 2 / np.maximum(np.sum(wave**2, axis=1), 1e-300)
    for _ in range(peaks):
        at = int(np.argmax(power))
        found.append(s.span / n[at])
        power[max(at - 3, 0) : at + 4] = 0.0
    return found


def _cogging(s: Scene) -> list[Column]:
    def entry(c: Floats, period: float) -> Entry:
        amplitude, phase = _waves(c)
        return {"name": "cogging", "amplitude": amplitude, "period": period, "phase": phase}

    return _periodic(s, "cogging", np.ones_like(s.x), -1.0, entry)


def _ripple(s: Scene) -> list[Column]:
    drive = s.force_constant * s.volts

    def entry(c: Floats, period: float) -> Entry:
        amplitude, phase = _waves(c)
        return {"name": "torque-ripple", "amplitude": min(amplitude, 0.9), "period": period, "phase": phase}

    return _periodic(s, "torque-ripple", drive, -1.0, entry)


def _friction_along(s: Scene) -> list[Column]:
    force = s.fitted.hysteresis

    def entry(c: Floats, period: float) -> Entry:
        amplitude, phase = _waves(c)
        return {
            "name": "position-dependent-friction",
            "amplitude": min(amplitude, 0.9),
            "period": period,
            "phase": phase,
        }

    waves = _periodic(s, "position-dependent-friction", force, 1.0, entry)
    slope = Column(
        "position-dependent-friction",
        lambda: [force * s.x],
        lambda c: {"name": "position-dependent-friction", "amplitude": 0.0, "period": s.span, "slope": c[0]},
    )
    return [*waves, slope]


def _tone(s: Scene) -> list[Column]:
    strip = int(np.argmax([p.time.size for p in s.motion.strips]))
    rows = s.motion.plain([s.motion.strips[strip].time]).size
    start = sum(s.motion.plain([p.time]).size for p in s.motion.strips[:strip])
    part = s.residual[start : start + rows]
    rate = s.motion.rate / s.motion.thinning
    spectrum = np.abs(np.fft.rfft(part * np.hanning(rows), 4 * rows)) ** 2
    frequency = np.fft.rfftfreq(4 * rows, 1 / rate)
    lowest = max(10.0 * rate / rows, 1.0)  # slower, it is no tone but part of the motion's own band
    spectrum[(frequency < lowest) | (frequency > s.motion.cut * 1.2)] = 0.0
    # A line stands out of its neighbourhood, whatever the motion puts around it.
    width = 201
    around = np.convolve(spectrum, np.ones(width) / width, mode="same") + 1e-300
    found = []
    ratio = np.where(spectrum > 0, spectrum / around, 0.0) * np.sqrt(spectrum)
    for _ in range(4):
        at = int(np.argmax(ratio))
        found.append(float(frequency[at]))
        ratio[max(at - 12, 0) : at + 13] = 0.0

    def column(f: float) -> Column:
        def columns() -> list[Floats]:
            angle = 2 * np.pi * f * s.time
            return [-np.sin(angle), -np.cos(angle)]

        def compose(c: Floats) -> Entry:
            amplitude, phase = _waves(c)
            return {"name": "tonal-disturbance", "amplitude": amplitude, "frequency": f, "phase": phase}

        return Column("tonal-disturbance", columns, compose)

    return [column(f) for f in found if f > 0]


def _drift_of_level(s: Scene) -> list[Column]:
    total = float(s.time.max())
    force = s.fitted.hysteresis

    def column(tau: float) -> Column:
        return Column(
            "friction-drift",
            lambda: [force * -np.expm1(-s.time / tau)],
            lambda c: {
                "name": "friction-drift",
                "change": float(np.clip(c[0], -0.9, 5.0)),
                "time_constant": tau,
            },
        )

    return [column(total * part) for part in (0.05, 0.15, 0.4, 1.0, 3.0)]


KNOTS = (12, 24, 48)
"""Numbers of knots tried for a force that depends on position in a shape that nothing else explains."""


def _any_shape(s: Scene) -> list[Column]:
    low, high = s.motion.stroke

    def column(count: int) -> Column:
        knots = np.linspace(low, high, count)

        def columns() -> list[Floats]:
            return [-np.interp(s.x, knots, one) for one in np.eye(count)]

        def compose(c: Floats) -> Entry:
            values = [float(v) for v in c]
            return {"name": "position-force", "knots": [float(k) for k in knots], "values": values}

        return Column("position-force", columns, compose)

    return [column(count) for count in KNOTS]


def _end_stop(s: Scene) -> list[Column]:
    found = []
    for side in (1.0, -1.0):
        for part in (0.5, 0.7, 0.85, 0.93, 0.98):
            at = float(np.quantile(s.x, part if side > 0 else 1 - part))
            if side * at <= 0:
                continue  # the entry is a stop on the side of its sign

            def columns(at: float = at, side: float = side) -> list[Floats]:
                return [side * np.maximum(side * (s.x - at), 0.0)]

            def compose(c: Floats, at: float = at) -> Entry:
                return {"name": "end-stop", "position": at, "stiffness": max(float(c[0]), 0.0)}

            found.append(Column("end-stop", columns, compose))
    return found


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
    points += [{"name": "frictional-lag", "time_constant": t} for t in (2e-3, 1e-2, 5e-2)]
    return [Point(p) for p in points]


def _presliding(s: Scene) -> list[Point]:
    reach = float(s.fitted.ledger.reaches.max())
    points: list[Entry] = [{"name": "asymmetric-friction", "asymmetry": a} for a in (-0.2, -0.05, 0.05, 0.2)]
    points += [{"name": "non-congruent-friction", "softening": a} for a in (0.05, 0.2, 0.5)]
    points += [{"name": "load-dependent-friction", "coefficient": a} for a in (0.03, 0.15)]
    points += [
        {"name": "stiction-ageing", "growth": g, "distance": d * reach}
        for g in (0.05, 0.2)
        for d in (0.1, 1.0)
    ]
    points += [
        {"name": "creep", "fraction": f, "time_constant": t} for f in (0.05, 0.2) for t in (0.03, 0.3, 3.0)
    ]
    points += [{"name": "backlash", "gap": g * reach} for g in (0.03, 0.1, 0.25, 0.6, 1.5)]
    return [Point(p) for p in points]


def _inertial(s: Scene) -> list[Point]:
    mass = s.fitted.ledger.stage.mass
    points: list[Entry] = [{"name": "inertia", "mass": mass * f} for f in (0.5, 0.75, 1.3, 1.8)]
    for f in np.geomspace(4.0, 1.5 * s.motion.cut, 9):
        points += [
            {"name": "resonance", "frequency": float(f), "damping": z, "mass_ratio": r}
            for z in (0.03, 0.15)
            for r in (0.1, 0.5)
        ]
    return [Point(p) for p in points]


def _sensing(s: Scene) -> list[Point]:
    points: list[Entry] = []
    noise = max(
        float(np.hypot(s.fitted.ledger.stage.sensor.noise, s.fitted.ledger.stage.sensor.resolution)), 1e-9
    )
    for period in _cyclic_periods(s):
        points += [
            {"name": "sensor-periodic-error", "amplitude": a * noise, "period": period, "phase": p}
            for a in (5.0, 20.0)
            for p in (0.0, math.pi / 2, math.pi, -math.pi / 2)
        ]
    reach = float(s.fitted.ledger.reaches[0])
    total = float(s.time.max())
    points += [
        {"name": "sensor-drift", "drift": d * reach, "time_constant": t * total}
        for d in (-5.0, -0.5, 0.5, 5.0)
        for t in (0.1, 0.5)
    ]
    if _changes_once(s):
        points += [
            {"name": "sensor-jump", "size": d * reach, "time": t}
            for t in _steps(s)
            for d in (-2.0, -0.3, 0.3, 2.0)
        ]
    return [Point(p) for p in points]


def _cyclic_periods(s: Scene, peaks: int = 2) -> list[float]:
    """Return periods (m) whose apparent acceleration stands out of the residual."""
    mass = s.fitted.ledger.stage.mass
    step = float(np.quantile(np.abs(np.diff(s.x)), 0.5)) or s.span / 1000
    n = np.arange(3.0, min(400.0, s.span / (3 * step)), 0.2)
    if n.size == 0:
        return []
    power = np.zeros(n.size)
    weight = mass * s.v**2
    for i in range(0, n.size, 64):
        angle = 2 * np.pi * np.outer(n[i : i + 64], s.x / s.span)
        for wave in (np.sin(angle), np.cos(angle)):
            wave *= weight
            power[i : i + 64] += (wave @ s.residual) ** 2 / np.maximum(np.sum(wave**2, axis=1), 1e-300)
    found = []
    for _ in range(peaks):
        at = int(np.argmax(power))
        found.append(s.span / float(n[at]))
        power[max(at - 3, 0) : at + 4] = 0.0
    return found


def _changes_once(s: Scene) -> bool:
    """Tell whether the residual is unlike before and after some time."""
    total = np.cumsum(s.residual - s.residual.mean())
    return bool(np.ptp(total) > 0)


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


def names_of(searched: Sequence[Column | Point]) -> list[str]:
    """Return the names that were tried, each once."""
    return list(dict.fromkeys(s.name for s in searched))
