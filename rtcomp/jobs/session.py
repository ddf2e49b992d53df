"""One run of the loop as a job makes it: device, tick, clock, ring and recorder, together."""

from __future__ import annotations

import contextlib
import json
import math
import platform
import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from signal import SIGINT
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.registry import create

from rtcomp import __version__
from rtcomp.control.limits import limit_state, limit_vector
from rtcomp.control.pid import pid_state, pid_vector
from rtcomp.errors import ConfigError, Interrupted
from rtcomp.hysteresis.conditioning import low_pass
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.learner import Learner
from rtcomp.hysteresis.lms import Lms
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.hysteresis.rls import Rls
from rtcomp.interrupts import stop_on_signals
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.plan import ReferencePlan, VoltagePlan
from rtcomp.jobs.tick_settings import check_size, tick_settings
from rtcomp.kernels import Floats
from rtcomp.loop.clock import VirtualClock, WallClock
from rtcomp.loop.device import Device
from rtcomp.loop.realtime import PRIORITY, in_force, realtime_process
from rtcomp.loop.ring import Ring
from rtcomp.loop.run import Outcome, run
from rtcomp.loop.stop_watch import stop_watch
from rtcomp.loop.tick import COLUMNS, Tick
from rtcomp.recording.reader import Recording
from rtcomp.recording.recorder import Recorder, RecorderSummary

RING_SECONDS = 8.0
"""How long the recorder may be held up before rows are lost."""
LEAST_TICKS = 64
"""Rows from which an interrupted run can be judged."""
GIVEN_TRUST = 3.0
"""Trust (see `Rls`) in which a learner begins that was given a model: it may be wrong, it is not nothing."""
WEIGHTS_EVERY = 0.1
"""s between two stored sets of weights."""


class Watch(Protocol):
    """Somebody who looks at a run: told from inside in virtual time, from outside on a wall clock."""

    def update(self, done: int, ticks: int, ring: Ring, columns: tuple[str, ...]) -> None:
        """Look at the newest rows; called at most ten times a second."""

    def attach(self, ring: Ring, columns: tuple[str, ...], ticks: int) -> AbstractContextManager[None]:
        """Watch the ring from another process until the context ends."""


@dataclass(frozen=True)
class Run:
    """What a run left: the recorded columns, the history of the weights, and how it went."""

    columns: dict[str, Floats]
    weights_time: Floats
    """s, (M,)."""
    weights: Floats
    """(M, N + 1): the weights and the offset's weight, every `WEIGHTS_EVERY` seconds; where the elements
    move, (M, 2 N + 1) with their widths (m) then."""
    outcome: Outcome
    tick: Tick
    delay_ticks: int
    rate_hz: float
    realtime: Mapping[str, str]
    counters: Mapping[str, int] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    """What a person should know of the device before relying on it."""
    recorder: RecorderSummary | None = None
    signal: int = SIGINT
    """The signal that stopped it, where ``outcome.stopped_by`` says that one did."""

    @property
    def doubtful(self) -> npt.NDArray[np.bool_]:
        """Rows (K,) whose position was not measured at their time: stale samples, late and lost ticks."""
        return np.asarray((self.columns["status"] != 0) | (self.columns["overrun"] != 0))

    @property
    def measured(self) -> npt.NDArray[np.bool_]:
        """Rows (K,) that hold a new measurement, late or not."""
        return np.asarray((self.columns["status"] == 0) & (self.columns["overrun"] != 2))

    def tracking_error(self, settle: float = 0.0) -> tuple[Floats, Floats]:
        """Return time (s) and reference less position (m) of every measurement after `settle` seconds."""
        rows = self.measured & (self.columns["time"] >= settle)
        error = (self.columns["reference"] - self.columns["position"])[rows]
        return self.columns["time"][rows], error


def make_device(
    config: Configuration, recording: Recording | None = None, start: float = 0.0, substeps: float = 1.0
) -> Device:
    """Build the configured device (a `recording` is replayed); it is not opened. Raises ConfigError.

    `start` (m) and `substeps` are for simulated stages.
    """
    bench = Bench(
        stage=config.plant or config.stage,
        period=config.period,
        seed=config.run.seed,
        realtime=config.wall_clock,
        recording=recording,
        start=start,
        substeps=substeps,
    )
    settings: Mapping[str, Any] = {"driver": "replay"} if recording is not None else config.run.device
    given = recording is None and "device" in config.file.data
    return create(settings, bench, config.file if given else None)


def _sections(config: Configuration) -> Floats:
    smoothing = config.run.identify.smoothing if config.run.identify is not None else 0.0
    try:
        return low_pass(smoothing, config.stage.rate)
    except ConfigError as error:
        says = str(error).removeprefix("identify: smoothing ")
        raise config.file.error(("identify", "smoothing"), says) from error


def check(config: Configuration, *sections: str) -> None:
    """Raise what running the references of `sections` would raise before anything is opened or written.

    ConfigError for the device's settings, the model or a controller that is missing, LimitError for a
    reference that stage or limits do not allow.
    """
    for section in sections:
        config.reference(section)
    make_tick(config, make_device(config).delay_ticks)


def make_tick(
    config: Configuration,
    delay_ticks: int,
    model: HysteresisModel | None = None,
    *,
    closed_loop: bool = True,
) -> Tick:
    """Put the tick together: the configured basis and learner, or a model's basis with its weights."""
    section = config.run.identify
    stage = config.stage
    if model is not None:
        basis = config.moving(model.basis)
    else:
        # Without a section identify nothing learns: a basis of one interval fills the place.
        basis = config.basis() if section is not None else IntervalBasis([1.0])
    check_size(config, basis.size)
    learner = config.learner() if section is not None else Lms()
    offset = section.offset if section is not None else True
    controller = stage.controller
    if closed_loop and controller is None:
        raise ConfigError(
            f"{config.path}: section controller is missing; following a reference needs one, say at least "
            "controller.kp (V/m)"
        )
    limits = config.run.limits
    voltage = config.voltage_limit if closed_loop else 1e9
    gains = (controller.kp, controller.ki, controller.kd) if controller is not None else (0.0, 0.0, 0.0)
    tick = Tick(
        tick_settings(config, delay_ticks, closed_loop),
        basis,
        learner,
        sections=_sections(config),
        pid=(pid_vector(*gains, period=config.period, voltage_limit=voltage), pid_state()),
        limits=(limit_vector(voltage, config.period, limits.slew or np.inf), limit_state()),
        learn_offset=offset,
    )
    if model is not None:
        offset_weight = model.offset / tick.offset_scale if tick.offset_scale else 0.0
        tick.adopt_weights(np.append(model.weights, offset_weight), _knowing(learner, tick))
    return tick


def _knowing(learner: Learner, tick: Tick) -> Floats | None:
    """Return the state of a learner that was given a model, or None where it keeps nothing of what it knows.

    One that takes the weights for nothing makes them jump with its first updates, and the feedforward with
    them: learning on would cost more than it mends.
    """
    if not isinstance(learner, Rls) or learner.trust <= GIVEN_TRUST:
        return None
    less = Rls(learner.forgetting, GIVEN_TRUST, learner.drift)
    return less.initial_state(tick.scales, tick.basis.likeness())


def run_loop(
    config: Configuration,
    plan: ReferencePlan | VoltagePlan,
    device: Device,
    tick: Tick,
    *,
    path: Path | None = None,
    watch: Watch | None = None,
    metadata: Mapping[str, Any] | None = None,
    partial: bool = False,
    priority: int = PRIORITY,
) -> Run:
    """Run the loop once; record to `path` (HDF5) where one is given, in memory where not.

    On a wall clock it asks for SCHED_FIFO of `priority`.

    Raises what the loop raises (DeviceError, LimitError, EmergencyStopError), and Interrupted where a signal
    has ended the run (with `partial` only where it did so in the first moments); the recording up to there is
    kept.
    """
    wall = config.wall_clock and tick.closed_loop
    columns = tuple(COLUMNS)
    capacity = plan.ticks if path is None else max(4096, int(RING_SECONDS * config.stage.rate))
    ring = Ring.create(capacity, tick.row_width)
    recorder: Recorder | None = None
    in_loop = in_force()
    try:
        with contextlib.ExitStack() as stack:
            if path is not None:
                about = describe(config, tick, metadata)
                recorder = Recorder.start(
                    path, ring, columns, about, weights_columns=tick.row_width - len(columns),
                    axis=config.stage.axis, later=tuple(in_loop),
                )  # fmt: skip
            stop = stack.enter_context(stop_on_signals())
            if tick.closed_loop:
                keys = wall and config.real_device and sys.stdin is not None and sys.stdin.isatty()
                stack.enter_context(stop_watch(ring, config.stop_file, keys))
            if wall and watch is not None:
                stack.enter_context(watch.attach(ring, columns, plan.ticks))
            if wall:
                in_loop = stack.enter_context(realtime_process(priority))
            if recorder is not None:
                recorder.fill(in_loop)
            outcome = run(
                device,
                tick,
                plan,
                WallClock() if wall else VirtualClock(),
                ring,
                stop=stop,
                progress=None if watch is None else lambda n, _: watch.update(n, plan.ticks, ring, columns),
                recorder_alive=None if recorder is None else lambda: recorder.alive,
                tell=None if recorder is None else recorder.tell,
                spare_stand_ins=config.run.loop.slots_lost is None,
            )
            if not wall and watch is not None:
                watch.update(plan.ticks, plan.ticks, ring, columns)
    finally:
        summary = recorder.finish() if recorder is not None else None
        if path is None:
            rows = ring.take()
        ring.release()
    if outcome.stopped_by == "signal" and not (partial and outcome.ticks >= LEAST_TICKS):
        raise Interrupted(stop.number, stopped(outcome.ticks * config.period, tick.closed_loop))
    counters = dict(getattr(device, "counters", {}))
    remarks = tuple(getattr(device, "remarks", ()))
    delay = device.delay_ticks
    if path is None:
        every = max(1, math.ceil(WEIGHTS_EVERY * config.stage.rate - 1e-6))  # as a recording holds them
        recorded = {name: rows[:, j].copy() for j, name in enumerate(columns)}
        history = rows[::every]
        return Run(
            recorded, history[:, 0].copy(), history[:, len(columns) :].copy(), outcome, tick, delay,
            config.stage.rate, in_loop, counters, remarks, signal=stop.number,
        )  # fmt: skip
    recorded, times, weights = read_back(path, columns)
    return Run(
        recorded, times, weights, outcome, tick, delay, config.stage.rate, in_loop, counters, remarks,
        summary, stop.number,
    )  # fmt: skip


def stopped(seconds: float, closed_loop: bool = True) -> str:
    """Say for a person where a signal has stopped a run."""
    return f"stopped after {seconds:.4g} s{' at zero volts' if closed_loop else ''}"


def read_back(path: Path, columns: tuple[str, ...]) -> tuple[dict[str, Floats], Floats, Floats]:
    """Read the columns and the weights' history of one of our own recordings, finished or not."""
    import h5py

    with h5py.File(path, "r") as file:
        rows = min(file[name].shape[0] for name in columns)  # a recorder that died may leave them uneven
        recorded = {name: file[name][:rows] for name in columns}
        sets = min(file["weights/time"].shape[0], file["weights/weights"].shape[0])
        return recorded, file["weights/time"][:sets], file["weights/weights"][:sets]


def describe(config: Configuration, tick: Tick, more: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the metadata of a recording: what ran, on what, as what."""
    import numba

    return {
        "rate_hz": config.stage.rate,
        "configuration": json.dumps(config.run.model_dump(mode="json", exclude_none=True)),
        "stage": json.dumps(config.stage.to_dict()),
        "clock": "wall" if config.wall_clock else "virtual",
        "delay_ticks": int(tick.delay_ticks),
        "armed": config.arming.armed,
        "allow_non_rt": config.arming.allow_non_rt,
        "rtcomp_version": __version__,
        "python_version": platform.python_version(),
        "numpy_version": np.__version__,
        "numba_version": numba.__version__,
        "machine": platform.platform(),
        **(more or {}),
    }
