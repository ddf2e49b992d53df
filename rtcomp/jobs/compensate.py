"""The job `compensate`: reference in, voltage out, error gone; the same controller with and without."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.follow import follow
from rtcomp.jobs.identify import ALWAYS, model_of
from rtcomp.jobs.session import Run, Watch, check
from rtcomp.stage.stage import Stage


@dataclass(frozen=True)
class Tracking:
    """How well a run followed its reference after settling: m, of the measured position."""

    rms: float
    peak: float

    @classmethod
    def of(cls, run: Run, settle: float) -> Tracking:
        """Judge a run, its first `settle` seconds left out."""
        error = run.tracking_error(settle)[1]
        return cls(float(np.sqrt(np.mean(error**2))), float(np.abs(error).max()))


@dataclass(frozen=True)
class Compensated:
    """Two runs along one reference, without and with feedforward."""

    config: Configuration
    model: HysteresisModel | None
    """The model used; with learning, as it was at the end. None where a stage was fed forward."""
    without: Run
    with_it: Run
    error_without: Tracking
    error_with: Tracking
    stage: Stage | None = None
    """The stage fed forward, where it was not a model."""

    @property
    def improvement(self) -> float:
        """Rms tracking error without over with."""
        return self.error_without.rms / self.error_with.rms

    @property
    def notes(self) -> list[str]:
        """What the device said of itself in either run."""
        return list(dict.fromkeys([*self.without.remarks, *self.with_it.remarks]))

    def summary(self) -> dict[str, Any]:
        """Return the figures, for `--json` and the result file."""
        return {
            "tracking_rms_without_m": self.error_without.rms,
            "tracking_rms_with_m": self.error_with.rms,
            "tracking_peak_without_m": self.error_without.peak,
            "tracking_peak_with_m": self.error_with.peak,
            "improvement": self.improvement,
            "ticks": self.with_it.outcome.ticks,
            "ticks_late": self.without.outcome.late + self.with_it.outcome.late,
            "slots_lost": self.without.outcome.lost + self.with_it.outcome.lost,
            "degraded": self.without.outcome.degraded + self.with_it.outcome.degraded,
            "taken_back": self.with_it.outcome.taken_back,
            "stopped_by": self.with_it.outcome.stopped_by,
            "notes": self.notes,
        }


def compensate(
    config: Configuration,
    model: HysteresisModel | None = None,
    *,
    stage: Stage | None = None,
    out: Path | None = None,
    watch: Watch | None = None,
) -> Compensated:
    """Follow the reference of the section ``compensate`` twice, without and with feedforward.

    What is fed forward is `model` with the inertia and known forces of the configured stage, or, where it is
    given, the whole chain of `stage`. With `out`, recordings are written there (without.h5, with.h5). Raises
    ConfigError for a stage of another kind of axis, or where it is to go with learning.
    """
    check(config, "compensate")
    section = config.run.compensate
    if stage is not None:
        check_stage(config, stage)
    learn = ALWAYS if section.learn else None
    without = follow(config, "compensate", model=model, path=_in(out, "without.h5"), watch=watch)
    with_it = follow(
        config,
        "compensate",
        learn=learn,
        model=model,
        stage=stage,
        feedforward_from=0.0,
        path=_in(out, "with.h5"),
        watch=watch,
    )
    if learn is not None:
        model = model_of(config, with_it.tick, with_it.columns["position"])
    return Compensated(
        config,
        model if stage is None else None,
        without,
        with_it,
        Tracking.of(without, section.settle),
        Tracking.of(with_it, section.settle),
        stage,
    )


def check_stage(config: Configuration, stage: Stage) -> None:
    """Raise ConfigError where `stage` cannot be fed forward on the configured axis."""
    if stage.axis != config.stage.axis:
        raise ConfigError(
            f"the stage to feed forward is {stage.axis}, the axis of {config.path} is "
            f"{config.stage.axis}; give the stage of this axis"
        )
    if config.run.compensate.learn:
        raise config.file.error(
            ("compensate", "learn"), "is true; a stage is fed forward as it is: leave learn out, or the stage"
        )


def live(
    config: Configuration,
    switch_at: float,
    fade: float,
    *,
    path: Path | None = None,
    watch: Watch | None = None,
) -> Run:
    """Identify and compensate in one run: learn from the start, feed forward from `switch_at` (s) on."""
    return follow(
        config,
        "",
        learn=ALWAYS,
        feedforward_from=switch_at,
        feedforward_fade=fade,
        path=path,
        watch=watch,
    )


def _in(out: Path | None, name: str) -> Path | None:
    return None if out is None else out / name
