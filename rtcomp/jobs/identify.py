"""The job `identify`: position and voltage in, hysteresis model out, while running or from a recording."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rtcomp.errors import Interrupted, RecordingError
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.hysteresis.shaped import ShapedIntervalBasis
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.follow import follow
from rtcomp.jobs.judge import Friction, Judgement, friction_of, judge, learning_curve
from rtcomp.jobs.known import completed
from rtcomp.jobs.motion_notes import motion_notes, still_rising
from rtcomp.jobs.plan import VoltagePlan
from rtcomp.jobs.session import Run, Watch, check, make_device, make_tick, run_loop, stopped
from rtcomp.jobs.shape.that_pays import that_pays
from rtcomp.kernels import Floats
from rtcomp.loop.tick import Tick
from rtcomp.recording.reader import Recording
from rtcomp.stage.balance import bandwidth, known_force, zero_phase

ALWAYS = (0.0, float("inf"))


@dataclass(frozen=True)
class Identified:
    """A model, the run that it was learned in, and what it is worth."""

    config: Configuration
    model: HysteresisModel
    run: Run
    in_sample: Judgement
    held_out: Judgement | None
    """On motion not learned from; None where the configuration and recording have none."""
    curve_time: Floats
    """s, when the weights of the learning curve were in force, (M,)."""
    curve: Floats
    """Relative error of those weights, frozen, on the held-out motion (else in-sample), (M,)."""
    notes: list[str] = field(default_factory=list)
    signal: int | None = None
    """The signal that ended it early; None where it ran to its end."""

    def summary(self) -> dict[str, Any]:
        """Return the figures, for `--json` and the result file."""
        outcome = self.run.outcome
        return {
            "held_out_error": None if self.held_out is None else self.held_out.relative,
            "held_out_rms_n": None if self.held_out is None else self.held_out.rms,
            "in_sample_error": self.in_sample.relative,
            "in_sample_rms_n": self.in_sample.rms,
            "friction_level_n": friction_level(self.model),
            "intervals_reached": int(np.count_nonzero(self.model.reached))
            if self.model.reached is not None
            else None,
            "updates": outcome.updates,
            "ticks": outcome.ticks,
            "ticks_late": outcome.late,
            "slots_lost": outcome.lost,
            "degraded": outcome.degraded,
            "taken_back": outcome.taken_back,
            "stopped_by": outcome.stopped_by if self.signal is None else "signal",
            "notes": self.notes,
        }


def friction_level(model: HysteresisModel) -> float:
    """Return the force (N) of the model with every element saturated, what gives it shape left out."""
    basis = model.basis
    n = basis.widths.size if isinstance(basis, ShapedIntervalBasis) else basis.size
    return float(np.sum(np.abs(model.weights[:n]) * basis.scales()[:n]))


def identify(
    config: Configuration,
    recording: Recording | None = None,
    *,
    out: Path | None = None,
    watch: Watch | None = None,
) -> Identified:
    """Identify the hysteresis of the configured device while it follows the reference, or of a recording.

    The weights are learned tick by tick in the loop. They are then frozen and judged on the motion of the
    section ``judge``. With `out`, recordings are written there (recording.h5, judge.h5).
    """
    if recording is not None:
        return _from_recording(config, recording, out, watch)
    check(config, "", *(["judge"] if config.run.judge.reference is not None else []))
    learned = follow(
        config, "", learn=learning_window(config), path=_in(out, "recording.h5"), watch=watch, partial=True
    )
    model = model_of(config, learned.tick, learned_positions(config, learned))
    own = friction(config, learned)
    model, shape_notes = that_pays(config, model, own, learning_window(config))
    settle = config.run.judge.settle
    # A run stopped early is judged all the same: on its second half at least.
    settle = min(settle, 0.5 * float(learned.columns["time"][-1]))
    in_sample = judge(model, own, settle=settle)
    held_out, on, number = None, own, None
    of_motion = [*motion_notes(model, learned_positions(config, learned)), *still_rising(model, own)]
    notes = [*learned.remarks, *of_motion, *shape_notes]
    unjudged = "the model was not judged on other motion"
    if learned.outcome.stopped_by == "signal":
        number = learned.signal
        notes.append(f"learning {stopped(learned.outcome.ticks * config.period)}; {unjudged}")
    elif config.run.judge.reference is not None and learned.outcome.stopped_by == "end":
        try:
            on = friction(config, follow(config, "judge", path=_in(out, "judge.h5"), watch=watch))
            held_out = judge(model, on, settle=settle)
        except Interrupted as error:  # what has been learned is not thrown away
            number = error.number
            notes.append(f"judging {error}; {unjudged}")
    curve = learning_curve(learned.tick.basis, learned.weights, learned.tick.offset_scale, on, settle=settle)
    return Identified(config, model, learned, in_sample, held_out, learned.weights_time, curve, notes, number)


def learning_window(config: Configuration) -> tuple[float, float]:
    """Return when (s) the weights may change."""
    learn = config.identify.learn
    return ALWAYS if learn is None else (learn[0], learn[1])


def friction(config: Configuration, run: Run) -> Friction:
    """Return the friction that a run of the loop measured."""
    c = run.columns
    smoothing = config.run.identify.smoothing if config.run.identify is not None else 0.0
    # Judged as measured: only where noise asked for a low cut-off does the judgement smooth as well.
    smoothing = smoothing if 0.0 < smoothing < bandwidth(run.rate_hz) else 0.0
    return friction_of(
        config.stage, c["time"], c["position"], c["voltage"], run.delay_ticks, smoothing, run.doubtful
    )


def learned_positions(config: Configuration, run: Run) -> Floats:
    """Return the positions (m) of a run up to the end of learning."""
    end = learning_window(config)[1]
    time, position = run.columns["time"], run.columns["position"]
    return np.asarray(position[time <= end] if end < time[-1] else position)


def model_of(config: Configuration, tick: Tick, positions: Floats) -> HysteresisModel:
    """Take the weights out of a tick, with the prior applied, as a model."""
    return completed(
        config.identify, tick.settled_basis, tick.weights, tick.offset_scale, positions, config.period,
        lambda: tick.learner.information(tick.identifier.ls, tick.scales),
    )  # fmt: skip


def _from_recording(
    config: Configuration, recording: Recording, out: Path | None, watch: Watch | None
) -> Identified:
    section = config.run.recording
    config = config.changed(rate=recording.rate_hz)
    position = bridged(recording)
    time = recording.time - recording.time[0]
    for key, given in (("identify.learn", config.identify.learn), ("judge.window", config.run.judge.window)):
        if given is not None and not np.any((time >= given[0]) & (time <= given[1])):
            raise RecordingError(
                f"{recording.path}: no row lies in {key}, {given[0]:g} to {given[1]:g} s; the recording "
                f"takes {time[-1]:g} s"
            )
    slow = zero_phase(position, bandwidth(recording.rate_hz), recording.rate_hz)
    speed = np.gradient(slow, config.period)
    known = known_force(config.stage, time, slow, speed, viscous=False)
    plan = VoltagePlan(
        recording.voltage,
        config.period,
        np.append(known[:1], known[:-1]),
        recording.reference if recording.reference is not None else position,
        learning_window(config),
    )
    device = make_device(config, recording)
    tick = make_tick(config, section.delay_ticks, closed_loop=False)
    learned = run_loop(config, plan, device, tick, path=_in(out, "recording.h5"), watch=watch)
    learn_end = learning_window(config)[1]
    model = model_of(config, learned.tick, position[time <= learn_end])
    smoothing = config.identify.smoothing
    own = friction_of(
        config.stage,
        time,
        recording.position,
        recording.voltage,
        section.delay_ticks,
        smoothing,
        ~recording.trusted,
    )
    model, shape_notes = that_pays(config, model, own, learning_window(config))
    window = config.run.judge.window
    settle = config.run.judge.settle
    first = config.identify.learn[0] if config.identify.learn is not None else 0.0
    last = min(learn_end, float(time[-1]))
    in_sample = judge(model, own, (first, last), settle)
    held_out = judge(model, own, (window[0], window[1]), 0.0) if window is not None else None
    curve = learning_curve(
        learned.tick.basis,
        learned.weights,
        learned.tick.offset_scale,
        own,
        (window[0], window[1]) if window is not None else (first, last),
    )
    of_motion = [*motion_notes(model, recording.position[time <= learn_end]), *still_rising(model, own)]
    notes = [*recording.notes, *of_motion, *shape_notes]
    return Identified(config, model, learned, in_sample, held_out, learned.weights_time, curve, notes)


def bridged(recording: Recording) -> Floats:
    """Return the position (m) with doubtful rows (outliers, gaps) bridged by straight lines."""
    good = recording.trusted
    return np.interp(recording.time, recording.time[good], recording.position[good])


def _in(out: Path | None, name: str) -> Path | None:
    return None if out is None else out / name
