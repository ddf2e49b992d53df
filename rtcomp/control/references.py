"""References: where the stage shall be, at any time, with velocity and acceleration.

Every motion starts at rest at `start`, where the stage stands, and never jumps. Motions that repeat
(triangle, sine, multisine), a file's and a hold grow out of it: over the fade time Tf

    x(t) = start + B(t / Tf) (motion(t) - start),    B(s) = 10 s^3 - 15 s^4 + 6 s^5,

whose velocity and acceleration begin at zero. Motions made of strokes (nested reversals, minor loops) begin
at rest of their own and need no fade.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rtcomp.control import motions, strokes, tables
from rtcomp.control.strokes import smooth_step
from rtcomp.errors import LimitError
from rtcomp.kernels import Floats

if TYPE_CHECKING:
    from rtcomp.control.reference_settings import ReferenceSettings

_ROUND = 1e-4
"""Extremes are found on a grid of 256 times an oscillation; this is what may lie between."""


class Reference:
    """A motion with its delay and its smooth start. Build it with `from_dict` or `build_reference`."""

    def __init__(
        self, motion: motions.Motion, settings: ReferenceSettings, *, fade: float, duration: float
    ) -> None:
        self.motion = motion
        self.settings = settings
        self.kind: str = settings.kind
        self.start = settings.start
        self.delay = settings.delay
        self.fade = fade
        """s; 0 where the motion starts at rest by itself."""
        self.duration = duration
        """s, of the whole run, delay included."""
        self.period = motion.period
        """s, after the start; None where nothing repeats."""
        self.earlier = 0.0
        """s of motion before time zero (`following_on.FollowingOn` has some)."""

    def evaluate(self, t: npt.ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return position (m), velocity (m/s) and acceleration (m/s^2) at the times `t` (s), of its shape.

        Defined for all times: at rest at `start` before the motion begins; after `duration` a repeating
        motion goes on and any other rests. So ``evaluate(t + lead)`` works for any lead.
        """
        u = np.asarray(t, dtype=np.float64) - self.delay
        x, v, a = self.motion.evaluate(np.maximum(u, 0.0))
        if self.fade > 0.0:
            b, db, ddb = smooth_step(u / self.fade)
            way = x - self.start
            rate = db / self.fade
            x, v, a = (
                self.start + b * way,
                b * v + rate * way,
                b * a + 2.0 * rate * v + ddb / self.fade**2 * way,
            )
        before = u < 0.0
        return np.where(before, self.start, x), np.where(before, 0.0, v), np.where(before, 0.0, a)

    @cached_property
    def _extremes(self) -> tuple[float, float, float, float]:
        marks = self.motion.landmarks(1.1 * self.duration)
        if self.fade > 0.0:
            growing = np.linspace(0.0, self.fade, 4097)
            whole = self.period if self.period is not None else np.inf
            turns = int(min(np.ceil(self.fade / whole) + 1.0, 200.0)) if np.isfinite(whole) else 1
            marks = np.concatenate([growing, *(marks + k * whole for k in range(1, turns)), marks])
        marks = np.concatenate([[0.0], marks])
        x, v, a = self.evaluate(marks + self.delay)
        return float(x.min()), float(x.max()), float(np.abs(v).max()), float(np.abs(a).max())

    @property
    def span(self) -> tuple[float, float]:
        """Lowest and highest position (m)."""
        low, high, _, _ = self._extremes
        slack = _ROUND * (high - low) if self.fade > 0.0 else 0.0
        return low - slack, high + slack

    @property
    def peak_speed(self) -> float:
        """Largest speed (m/s), to 1e-4 and never below it."""
        return self._extremes[2] * (1.0 + _ROUND)

    @property
    def peak_acceleration(self) -> float:
        """Largest acceleration (m/s^2), to 1e-4 and never below it."""
        return self._extremes[3] * (1.0 + _ROUND)

    def to_dict(self) -> dict[str, Any]:
        """Return the `reference:` section that gives this reference."""
        return self.settings.model_dump(mode="json", exclude_none=True, exclude_defaults=True) | {
            "kind": self.kind
        }

    @classmethod
    def from_dict(
        cls, entry: Mapping[str, Any], *, start: float | None = None, folder: Path | None = None
    ) -> Reference:
        """Build from a `reference:` section; see `build_reference`. Raise ConfigError in one line."""
        from rtcomp.control.reference_settings import reference_settings

        return build_reference(reference_settings(entry), start=start, folder=folder)

    def __repr__(self) -> str:
        low, high = self.span
        return f"Reference({self.kind}, {low:g} to {high:g} m, {self.duration:g} s)"


def build_reference(
    settings: ReferenceSettings, *, start: float | None = None, folder: Path | None = None
) -> Reference:
    """Make the reference of `settings`.

    `start` (m), where the stage was found, takes the place of the section's; `folder` is where relative paths
    of files begin. Raises RecordingError for a file that cannot be used.
    """
    s = settings if start is None else settings.model_copy(update={"start": float(start)})
    if s.kind == "nested-reversals" or s.kind == "minor-loops":
        motion = _strokes(s)
        length = motion.length
        duration = s.delay + length if length is not None else getattr(s, "duration", 0.0)
        return Reference(motion, s, fade=0.0, duration=duration)
    if s.kind == "file":
        times, positions = tables.read_table((folder or Path()) / s.path)
        table = tables.Table(times, s.offset + s.scale * positions, s.interpolation)
        fade = float(times[-1]) / 10.0 if s.fade is None else s.fade
        return Reference(table, s, fade=fade, duration=s.delay + float(times[-1]))
    if s.kind == "hold":
        return Reference(motions.Still(s.offset, s.duration), s, fade=s.fade, duration=s.duration)
    wave: motions.Motion
    if s.kind == "triangle":
        wave = motions.RoundedTriangle(s.amplitude, s.frequency, s.phase, s.corner)
    elif s.kind == "sine":
        one = np.array([[s.amplitude], [s.frequency], [s.phase]])
        wave = motions.Harmonics(*one)
    else:
        wave = _multisine(s)
    grow = min(wave.period or s.duration / 10.0, s.duration / 2.0) if s.fade is None else s.fade
    return Reference(_Shifted(wave, s.offset), s, fade=grow, duration=s.duration)


class _Shifted:
    """A motion about another centre (m)."""

    def __init__(self, motion: motions.Motion, offset: float) -> None:
        self._motion, self._offset = motion, offset
        self.period, self.length = motion.period, motion.length

    def evaluate(self, t: Floats) -> motions.Triple:
        """Return the motion, shifted."""
        x, v, a = self._motion.evaluate(t)
        return x + self._offset, v, a

    def landmarks(self, until: float) -> Floats:
        """Return the motion's."""
        return self._motion.landmarks(until)


def _multisine(s: Any) -> motions.Harmonics:
    if s.band is not None:
        return motions.Harmonics.schroeder(s.band.low, s.band.high, s.band.count, s.amplitude)
    phases = s.phases if s.phases is not None else [0.0] * len(s.frequencies)
    return motions.Harmonics(np.array(s.amplitudes), np.array(s.frequencies), np.array(phases))


def _strokes(s: Any) -> strokes.Strokes:
    if s.kind == "nested-reversals":
        amplitudes = s.amplitudes or strokes.decaying(s.amplitude, s.ratio, s.count)
        return strokes.nested(
            s.start,
            s.offset,
            amplitudes,
            direction=s.direction,
            repeats=s.repeats,
            speed=s.speed,
            stroke_time=s.stroke_time,
            corner=s.corner,
            shape=s.shape,
        )
    up = [(loop.position, loop.size) for loop in s.loops if loop.branch in ("up", "both")]
    down = [(loop.position, loop.size) for loop in s.loops if loop.branch in ("down", "both")]
    return strokes.minor_loops(s.start, s.offset, s.amplitude, s.frequency, up, down, s.corner, s.shape)


def check(
    reference: Reference,
    *,
    stroke: tuple[float, float] | None = None,
    speed: float | None = None,
    acceleration: float | None = None,
) -> None:
    """Raise LimitError, in one line, where `reference` leaves the stroke (m) or is faster than allowed.

    `speed` in m/s, `acceleration` in m/s^2; None allows anything. A thousandth above a limit is within it.
    """
    low, high = reference.span
    name = f"reference {reference.kind}"
    if stroke is not None:
        slack = 1e-3 * (stroke[1] - stroke[0])
        for value, wrong in ((low, low < stroke[0] - slack), (high, high > stroke[1] + slack)):
            if wrong:
                raise LimitError(
                    f"{name}: goes to {value:.6g} m; the stroke allows {stroke[0]:g} to {stroke[1]:g} m; "
                    "make the amplitude smaller or move the offset"
                )
    if speed is not None and reference.peak_speed > speed * 1.001:
        raise LimitError(
            f"{name}: its speed reaches {reference.peak_speed:.4g} m/s; allowed is {speed:g} m/s; "
            "lower the frequency or the amplitude, or make the fade longer"
        )
    if acceleration is not None and reference.peak_acceleration > acceleration * 1.001:
        raise LimitError(
            f"{name}: its acceleration reaches {reference.peak_acceleration:.4g} m/s^2; allowed is "
            f"{acceleration:g} m/s^2; lower the frequency or the amplitude, or make the corner larger"
        )
