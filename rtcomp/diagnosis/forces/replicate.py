"""Bootstrap replicates: the current model simulated along the recorded motion, read by the believed sensor.

The recorded command drives the simulation and a feedback keeps it on the recorded motion: the stage's own
controller as loud as it was recorded, or one that its mass asks for. So recordings with and without a
reference, of known and unknown controllers, are replicated alike.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rtcomp.control.pid import pid_preset, pid_state, pid_step, pid_vector
from rtcomp.diagnosis.forces.controller import gains
from rtcomp.diagnosis.recordings.counts import counted
from rtcomp.diagnosis.recordings.data import Data, Segment, averaged
from rtcomp.kernels import Floats, compiled
from rtcomp.physics import Place, wires
from rtcomp.physics.program import COUNT, Program, run_chain
from rtcomp.stage.shoot import WIDER
from rtcomp.stage.simulate import MOST_IN_ALL, integrate, largest_step, largest_stiffness
from rtcomp.stage.stage import Stage

if TYPE_CHECKING:
    from rtcomp.diagnosis.forces.signals import Signals

BANDWIDTH = 1.0 / 30.0
"""Bandwidth of the feedback of a stage without controller, relative to the recording's rate."""
FINER = 8
"""Times the rate of the recording at which a band-limited command is played."""
DITHER = 0.1
"""Least noise of a reading, in counts: without any, one replicate would be like the other."""
LOST = 0.25
"""Part of the stroke off the recorded motion (rms), from which on a replicate is of no use."""


def replicate(stage: Stage, data: Data, motion: list[Floats], noise: float, seed: int) -> Data | None:
    """Return the recordings that `stage` would have left, or None where it cannot be kept on the motion.

    `motion` is the true position (m, (K,)) along each segment, `noise` (m rms) that of a recorded reading.
    Where rows are means, those that they are means of are simulated: a count at rest is no white noise.
    """
    random = np.random.default_rng(seed)
    low, high = data.stroke
    counts = counted(stage, data)
    recorded = data.as_recorded()
    beside = math.sqrt(max(noise**2 - counts**2 / 12.0, 0.0))  # counts, which are not white at rest
    rest = max(min(stage.sensor.noise, noise), beside, DITHER * counts)
    stage = stage.with_changes(sensor={"noise": rest, "resolution": counts})
    finer = _finer(data)
    along = zip(recorded.segments, motion, strict=True)
    steps = sum(s.time.size * finer * _steps(stage, recorded.period / finer, x) for s, x in along)
    if steps > MOST_IN_ALL:
        return None
    made: list[Segment] = []
    for means, segment, x in zip(data.segments, recorded.segments, motion, strict=True):
        followed = x if segment is means else np.interp(segment.time, means.time, x)
        position, voltage = _simulated(stage, recorded, segment, followed, random)
        off = position - segment.position
        if not np.all(np.isfinite(off)) or float(np.sqrt(np.mean(off**2))) > LOST * (high - low):
            return None
        new = replace(segment, position=position, voltage=voltage)  # its friction began there
        new = new if segment is means else averaged(new, data.averaged)
        made.append(replace(new, before=None, run_in=means.run_in))
    return replace(data, segments=tuple(made), early=0.0)


def left_by(stage: Stage, signals: Signals, seed: int = 0) -> Data | None:
    """Return the recordings that `stage` would have left along the motion of `signals`."""
    motion = [path.x for path in signals.paths()]
    return replicate(stage, signals.data, motion, signals.read_noise(stage), seed)


def followed(stage: Stage, path: Floats, rate: float) -> tuple[Floats, Floats]:
    """Return what a stage with a controller reads (m) and commands (V) along a path (m, (K,)), a row each."""
    segment = Segment(np.arange(path.size) / rate, path, np.zeros(path.size), path)
    return _simulated(stage, Data((segment,), rate, True), segment, path, np.random.default_rng(0))


def _gains(stage: Stage, period: float, rate: float, segment: Segment) -> Floats:
    if stage.controller is not None:
        return gains(stage, period, segment if segment.voltage.any() else None)
    omega = 2.0 * math.pi * BANDWIDTH * rate
    kp = stage.mass * omega**2 / stage.force_constant
    kd = 2.0 * stage.mass * omega / stage.force_constant
    return pid_vector(kp, 0.0, kd, period=period, voltage_limit=stage.voltage_limit)


def _simulated(
    stage: Stage, data: Data, segment: Segment, motion: Floats, random: np.random.Generator
) -> tuple[Floats, Floats]:
    """Return what is read (m) and commanded (V) at each row of a segment.

    A band-limited command goes on between rows: it is played at FINER times the rate.
    """
    moving = Program([e for e in stage.chain if e.place is not Place.SENSOR])
    sensing = Program([e for e in stage.chain if e.place is Place.SENSOR])
    follows = stage.controller is not None and segment.reference is not None
    target = segment.reference if follows and segment.reference is not None else motion
    command = np.zeros_like(segment.voltage) if follows else segment.voltage
    finer = _finer(data)
    if finer > 1:
        target, command = _between(target, finer), _between(command, finer)
        command = 0.5 * (command + np.append(command[1:], command[-1:]))  # held from here to the next
    period = data.period / finer
    stroke = WIDER * float(np.abs(motion).max())
    steps = _steps(stage, period, motion)
    base = np.array([stage.mass, stage.force_constant, largest_stiffness(stage, stroke), 0.0])
    w = np.zeros(wires.COUNT)
    w[wires.MASS] = stage.mass
    w[wires.POSITION] = motion[0]
    w[wires.TIME] = segment.time[0]
    w[wires.REACH] = w[wires.SCALE] = 1.0
    pid, state = _gains(stage, period, data.rate, segment), pid_state()
    pid_preset(
        pid, state, float(target[0] - motion[0]), float(motion[0]), float(segment.voltage[0] - command[0])
    )
    out = np.empty((2, target.size))
    _loop(
        moving.steps, moving.p, moving.s, sensing.steps, sensing.p, sensing.s, w, base, pid, state, target,
        command, random.standard_normal(target.size), finer == 1, stage.voltage_limit, period, steps, out,
    )  # fmt: skip
    volts = out[1]
    if finer > 1:  # what acts at a row is the mean of what was held before and after it
        volts = 0.5 * (volts + np.append(volts[:1], volts[:-1]))
    return out[0, ::finer].copy(), volts[::finer].copy()


def _finer(data: Data) -> int:
    """Return at how many times the rate of the recording its command is played."""
    return 1 if data.held else FINER


def _steps(stage: Stage, period: float, motion: Floats) -> int:
    """Return in how many steps a period (s) along a motion (m, (K,)) resolves what is stiff."""
    step = largest_step(stage, WIDER * float(np.abs(motion).max()))
    return max(1, math.ceil(period / step - 1e-9))


def _between(signal: Floats, finer: int) -> Floats:
    """Return a band-limited signal (K,) at so many times its rate, (K finer,)."""
    from scipy.signal import resample

    line = np.linspace(signal[0], signal[-1], signal.size)
    fine = np.interp(np.arange(signal.size * finer) / finer, np.arange(signal.size), line)
    return np.asarray(resample(signal - line, signal.size * finer) + fine)


@compiled
def _loop(
    steps: np.ndarray, p: Floats, s: Floats, sense: np.ndarray, sense_p: Floats, sense_s: Floats, w: Floats,
    base: Floats, gains: Floats, state: Floats, target: Floats, command: Floats, noise: Floats,
    noisy: bool, limit: float, period: float, count: int, out: Floats,
) -> None:  # fmt: skip
    """Fill `out` with what is read (m) and commanded (V), a row a period.

    The feedback is of the reading where that is `noisy`, else of the true position.
    """
    w[wires.GAIN] = base[1]
    run_chain(steps, p, s, w, 0, steps[COUNT])
    w[wires.ACCELERATION] = (w[wires.DRIVE] + w[wires.PUSH] - w[wires.FRICTION]) / w[wires.MASS]
    excess = 0.0
    for k in range(target.size):
        w[wires.SENSED], w[wires.NOISE] = w[wires.POSITION], noise[k]
        run_chain(sense, sense_p, sense_s, w, 0, sense[COUNT])
        read = w[wires.SENSED]
        fed = read if noisy else w[wires.POSITION]
        asked = command[k] + pid_step(gains, state, target[k] - fed, fed, excess)
        volts = min(max(asked, -limit), limit)
        excess = volts - asked
        out[0, k], out[1, k] = read, volts
        integrate(steps, p, s, w, base, volts, period, count)
