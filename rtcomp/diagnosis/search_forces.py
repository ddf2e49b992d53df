"""Forces tried as columns of free size: offset, damping, springs, waves along the way and in time, stops.

Periods, frequencies and places where a search starts come from the residual of the recording at hand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from rtcomp.diagnosis.periodogram import highest, periodogram
from rtcomp.diagnosis.scene import Column, Entry, Scene
from rtcomp.kernels import Floats


def forces(scene: Scene) -> Iterator[Column]:
    """Go through every force worth trying on this recording."""
    for make in (
        _constant, _by_speed, _spring, _cogging, _ripple, _friction_along, _tone,
        _drift_of_level, _end_stop, _any_shape,
    ):  # fmt: skip
        yield from make(scene)


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
            lambda: [np.abs(s.v), s.v],
            lambda c: {
                "name": "asymmetric-viscous-friction",
                "ratio": float(np.clip(c[0] / max(viscous + c[1], 1e-9 + 0.1 * viscous), -0.95, 0.95)),
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
    n, power = periodogram(s.x, s.span, weight, s.residual, max(most, 3.0))
    power[n < 2.5] = 0.0
    return found + [s.span / waves for waves in highest(n, power, peaks)]


def _cogging(s: Scene) -> list[Column]:
    def entry(c: Floats, period: float) -> Entry:
        amplitude, phase = _waves(c)
        return {"name": "cogging", "amplitude": amplitude, "period": period, "phase": phase}

    def column(period: float) -> Column:
        k = 2 * np.pi / period

        def columns() -> list[Floats]:
            return [-np.sin(k * s.x), -np.cos(k * s.x), -np.sin(2 * k * s.x), -np.cos(2 * k * s.x)]

        def compose(c: Floats) -> Entry:
            amplitude, phase = _waves(c[2:])
            second = {"order": 2.0, "amplitude": amplitude, "phase": phase}
            return {**entry(c[:2], period), "harmonics": [second]}

        return Column("cogging", columns, compose)

    one = np.ones_like(s.x)
    # Magnets and slots seldom pull as a sine does; found piece by piece, a free curve would come before it.
    return [*_periodic(s, "cogging", one, -1.0, entry), *(column(p) for p in _periods(s, one))]


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
    counts = [p.time[s.motion.kept(p)].size for p in s.motion.strips]
    longest = int(np.argmax(counts))
    rows, start = counts[longest], sum(counts[:longest])
    part = s.residual[start : start + rows]
    rate = s.motion.rate / s.motion.thinning
    spectrum = np.abs(np.fft.rfft(part * np.hanning(rows), 4 * rows)) ** 2
    frequency = np.fft.rfftfreq(4 * rows, 1 / rate)
    lowest = max(10.0 * rate / rows, 1.0)  # slower, it is no tone but part of the motion's own band
    spectrum[(frequency < lowest) | (frequency > s.motion.cut * 1.2)] = 0.0
    # A line stands out of its neighbourhood, whatever the motion puts around it.
    width = min(201, spectrum.size)
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
