"""The circle closed: an effect hidden in the plant, compensated unaware, diagnosed, compensated again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.result import Diagnosis
from rtcomp.errors import LimitError
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.compensate import Tracking
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.follow import follow
from rtcomp.jobs.identify import friction_level
from rtcomp.jobs.session import Run, Watch
from rtcomp.recording.acted import as_acted
from rtcomp.recording.reader import Recording, read
from rtcomp.stage.stage import Stage

Entry = dict[str, Any]
Draw = Callable[[np.random.Generator, "Scale"], Entry]


@dataclass(frozen=True)
class Scale:
    """What the sizes of hidden effects are measured by."""

    level: float
    """N, of friction."""
    stroke: float
    """m, half of the reference's travel."""
    speed: float
    """m/s, largest of the reference."""
    force_constant: float
    """N/V."""


def _cogging(r: np.random.Generator, s: Scale) -> Entry:
    return {
        "amplitude": r.uniform(0.15, 0.35) * s.level, "period": r.uniform(0.4, 0.9) * s.stroke,
        "phase": r.uniform(-np.pi, np.pi),
    }  # fmt: skip


def _asymmetric(r: np.random.Generator, s: Scale) -> Entry:
    return {"asymmetry": r.choice([-1.0, 1.0]) * r.uniform(0.2, 0.4)}


def _deadband(r: np.random.Generator, s: Scale) -> Entry:
    return {"width": r.uniform(0.2, 0.5) * s.level / s.force_constant}


def _position_dependent(r: np.random.Generator, s: Scale) -> Entry:
    return {
        "amplitude": r.uniform(0.2, 0.4), "period": r.uniform(0.5, 1.2) * s.stroke,
        "phase": r.uniform(-np.pi, np.pi), "slope": 0.0,
    }  # fmt: skip


def _spring(r: np.random.Generator, s: Scale) -> Entry:
    return {"stiffness": r.uniform(0.3, 0.8) * s.level / s.stroke}


def _stribeck(r: np.random.Generator, s: Scale) -> Entry:
    # Not so steep that sliding falls into stick-slip: feedback, not physics, would then set the error.
    return {"rise": r.uniform(0.1, 0.2), "velocity": r.uniform(0.4, 0.6) * s.speed}


def _tone(r: np.random.Generator, s: Scale) -> Entry:
    return {
        "amplitude": r.uniform(0.1, 0.25) * s.level, "frequency": r.uniform(8.0, 30.0),
        "phase": r.uniform(-np.pi, np.pi),
    }  # fmt: skip


HIDDEN: dict[str, Draw] = {
    "cogging": _cogging,
    "asymmetric-friction": _asymmetric,
    "drive-deadband": _deadband,
    "position-dependent-friction": _position_dependent,
    "parallel-spring": _spring,
    "stribeck": _stribeck,
    "tonal-disturbance": _tone,
}
"""What may be hidden, and how its size is drawn."""
CLOCKED = frozenset({"tonal-disturbance"})
"""Those that go by the stage's own time, which is known in simulation only."""


@dataclass(frozen=True)
class Circle:
    """Three runs along one reference, what was hidden from the second on, and what was found."""

    hidden: Entry
    ordinary: Run
    """The stage as believed, with the ordinary model fed forward."""
    ignorant: Run
    """The stage with the hidden effect, the ordinary model fed forward."""
    found: Diagnosis
    extended: Run
    """The stage with the hidden effect, the extended stage fed forward."""
    settle: float

    @property
    def errors(self) -> tuple[Tracking, Tracking, Tracking]:
        """Tracking errors of the three runs."""
        a, b, c = (Tracking.of(run, self.settle) for run in (self.ordinary, self.ignorant, self.extended))
        return a, b, c

    @property
    def named(self) -> list[str]:
        """What the diagnosis named, likeliest names only."""
        return [e.names[0] for e in self.found.effects]

    @property
    def right(self) -> bool:
        """Whether it named the hidden effect and nothing else."""
        return self.named == [self.hidden["name"]]

    @property
    def improvement(self) -> float:
        """Rms tracking error before over after the diagnosis, the effect hidden in both."""
        _, before, after = self.errors
        return before.rms / after.rms

    def summary(self) -> dict[str, Any]:
        """Return the figures, for `--json` and the result file."""
        a, b, c = self.errors
        return {
            "hidden": self.hidden,
            "named": [list(e.names) for e in self.found.effects],
            "right": self.right,
            "verdict": self.found.verdict,
            "tracking_rms_ordinary_m": a.rms,
            "tracking_rms_hidden_m": b.rms,
            "tracking_rms_diagnosed_m": c.rms,
            "tracking_peak_ordinary_m": a.peak,
            "tracking_peak_hidden_m": b.peak,
            "tracking_peak_diagnosed_m": c.peak,
            "improvement": self.improvement,
        }


def scale_of(config: Configuration, model: HysteresisModel) -> Scale:
    """Return what sizes are measured by on the configured axis, along the reference of ``compensate``."""
    reference = config.reference("compensate")
    low, high = reference.span
    return Scale(friction_level(model), 0.5 * (high - low), reference.peak_speed, config.stage.force_constant)


def draw(seed: int, scale: Scale, *, clock: bool = True) -> Entry:
    """Return an effect drawn at random, its size too.

    With `clock` false none that goes by the stage's own time.
    """
    random = np.random.default_rng(seed)
    names = [name for name in HIDDEN if clock or name not in CLOCKED]
    name = str(random.choice(names))
    return {"name": name, **{k: float(v) for k, v in HIDDEN[name](random, scale).items()}}


def believed(stage: Stage, model: HysteresisModel) -> Stage:
    """Return the stage with the identified model as its friction: what is believed after identification."""
    return stage.with_changes(stage={"friction": model.to_dict()})


def with_effect(stage: Stage, entry: Entry) -> Stage:
    """Return the stage with one more effect."""
    effects = stage.to_dict()["stage"].get("effects", [])
    return stage.with_changes(stage={"effects": [*effects, entry]})


def searching(config: Configuration, seconds: float | None = None) -> Configuration:
    """Return the configuration with a motion to diagnose in the place of the one of ``compensate``.

    A multisine as far as that motion goes and up to about three times as fast, from slow strokes over the
    whole length to small fast reversals; `seconds` long, else two and a half of its slowest periods. Where
    limits do not allow it, the configuration as it is.
    """
    reference = config.reference("compensate")
    low, high = reference.span
    half = 0.5 * (high - low)
    turn = reference.peak_speed / (2.0 * np.pi * half)
    band = {"low": _neat(0.2 * turn), "high": _neat(4.0 * turn), "count": 7}
    section = {
        "kind": "multisine", "amplitude": _neat(half), "band": band, "offset": 0.5 * (high + low),
        "duration": float(seconds or max(20.0, np.ceil(2.5 / band["low"]))),
    }  # fmt: skip
    given = config.file.data.get("compensate", {})
    changed = config.changed(compensate={**given, "reference": section, "learn": False})
    try:
        changed.reference("compensate")
    except LimitError:
        return config
    return changed


def _neat(value: float) -> float:
    """Return the value to two digits: a configuration is read by people."""
    return float(f"{value:.2g}")


def compensated(
    config: Configuration,
    name: str,
    model: HysteresisModel | None = None,
    stage: Stage | None = None,
    *,
    out: Path | None = None,
    watch: Watch | None = None,
) -> Run:
    """Follow the reference of ``compensate``, `model` or `stage` fed forward; recorded in `out` as `name`."""
    path = None if out is None else out / f"{name}.h5"
    return follow(
        config, "compensate", model=model, stage=stage, feedforward_from=0.0, path=path, watch=watch
    )


def close_circle(
    ordinary: Run,
    concealing: Configuration,
    hidden: Entry,
    model: HysteresisModel,
    *,
    out: Path | None = None,
    watch: Watch | None = None,
    progress: Callable[[float, str], None] | None = None,
) -> Circle:
    """Compensate twice on a plant with the effect `hidden`, before and after diagnosing the first of both.

    `concealing` believes what it believed when `ordinary` was run with `model` on the plant without the
    effect; only its plant is another. With `out` recordings are written there (hidden.h5, found.h5).
    """
    ignorant = compensated(concealing, "hidden", model, out=out, watch=watch)
    recording = recording_of(ignorant, None if out is None else out / "hidden.h5")
    found = diagnose(believed(concealing.stage, model), [recording], progress=progress)
    extended = compensated(concealing, "found", stage=found.stage, out=out, watch=watch)
    return Circle(hidden, ordinary, ignorant, found, extended, concealing.run.compensate.settle)


def recording_of(run: Run, path: Path | None) -> Recording:
    """Return the recording of a run with its commands where they acted: from its file, or from memory."""
    if path is not None:
        return as_acted(read(path))
    told = {"rtcomp_version": "", "rate_hz": run.rate_hz, "delay_ticks": run.delay_ticks}
    return as_acted(Recording(run.columns, run.rate_hz, told))
