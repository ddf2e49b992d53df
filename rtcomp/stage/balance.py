"""Both sides of a stage's force balance, on recorded or planned motion.

    mass * acceleration = force_drive - friction + other forces

The drive side is what the voltage produced, the motion side what the motion needed; a stage that is right
has them equal. The same kernels as in simulation are run over the rows of a motion, so memory (hysteresis)
starts relaxed at the first row.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.physics import Effect, Place, wires
from rtcomp.physics.program import Program, renew, run_chain
from rtcomp.physics.wires import (
    ACCELERATION,
    DRIVE,
    FRICTION,
    GRAIN,
    MASS,
    MOVED,
    POSITION,
    PUSH,
    STEP,
    TIME,
    VELOCITY,
    VOLTS,
)  # fmt: skip
from rtcomp.stage import lowpass
from rtcomp.stage.sensed import true_position
from rtcomp.stage.stage import Stage

PARTS = 8
"""Parts of a row over which the force of a drive is averaged: of one that remembers, their ends are taken, of
one that goes by the motion alone, their middles."""


@dataclass(frozen=True)
class Forces:
    """Forces along a motion, each (K,), N; and the moving mass, kg."""

    drive: Floats
    push: Floats
    friction: Floats
    mass: Floats
    rising: Floats
    falling: Floats
    """Push less friction over the row before each, weighed by what has passed of it, by what is to come."""
    drive_rising: Floats
    drive_falling: Floats
    """The same of the drive's force."""

    def held_drive(self) -> Floats:
        """Return the force of a drive whose command is held, (K,) N, as second differences see it."""
        return self.drive_rising + np.append(self.drive_falling[1:], self.drive_falling[-1:])

    def others(self) -> Floats:
        """Return push less friction, (K,) N, as second differences see it: its mean around each row."""
        if np.any(self.rising):
            return self.rising + np.append(self.falling[1:], self.falling[-1:])
        return around_rows(self.push - self.friction)


@dataclass(frozen=True)
class Balance:
    """Both sides of the balance, each (K,), N, smoothed alike below `bandwidth_hz`."""

    force_drive: Floats
    force_motion: Floats
    bandwidth_hz: float

    @property
    def relative_error(self) -> float:
        """Rms of the difference over the rms of the motion side."""
        difference = self.force_drive - self.force_motion
        return float(np.sqrt(np.mean(difference**2) / np.mean(self.force_motion**2)))


def forces(
    stage: Stage,
    chain: list[Effect],
    time: Floats,
    position: Floats,
    velocity: Floats,
    acceleration: Floats,
    volts: Floats,
    grain: float = 0.0,
    parts: int = 1,
) -> Forces:
    """Run the effects `chain` along a motion; all arrays (K,), equally spaced in time, SI units.

    `position` is the true one; effects of the sensor are left out. `volts` is the command that was held up
    to each row. Motion there and back within `grain` (m) is noise. Rows are cut into `parts`, or more where
    an effect needs it; the drive's force is the mean over them (of their middles where nothing in the chain
    remembers, by the trapezoidal rule where it does), the others are those at the row.
    """
    program = Program([e for e in chain if e.place is not Place.SENSOR])
    out = np.zeros((8, time.size))
    row = float((time[-1] - time[0]) / max(time.size - 1, 1))
    needed = parts_of(chain, row)
    motion = np.ascontiguousarray(np.column_stack([time, position, velocity, acceleration, volts]))
    base = np.array([stage.mass, stage.force_constant])
    w = np.zeros(wires.COUNT)
    w[GRAIN] = grain
    parts = max(needed, parts)
    middle = parts > 1 and needed == 1 and program.s.size == 1  # a spare one: nothing remembers
    ends = parts > 1 and _follows(chain)
    _along(program.steps, program.p, program.s, w, base, motion, parts, needed > 1, middle, ends, out)
    return Forces(*out)


def parts_of_drive(drive: Sequence[Effect]) -> int:
    """Return the parts of a row over which the force of `drive` is to be averaged."""
    return PARTS if any(not e.steady for e in drive) else 1


def _follows(chain: Sequence[Effect]) -> bool:
    """Tell whether the drive's force is continuous where the command steps, as behind a lag."""
    return any(e.place is Place.DRIVE and e.states and not e.averages for e in chain)


def parts_of(chain: Sequence[Effect], row: float) -> int:
    """Return the parts into which a row of `row` s is cut for the effects `chain`."""
    shortest = math.ceil(row / min((e.longest_step() for e in chain), default=math.inf) - 1e-9)
    return max(1, shortest, *(e.least_parts() for e in chain))


@compiled
def between_rows(motion: Floats, k: int, share: float) -> float:
    """Return the position (m) that `share` of a row before row `k`: the cubic by both rows' velocities."""
    before = max(k - 1, 0)
    row = motion[k, 0] - motion[before, 0]
    then, now = motion[before, 1], motion[k, 1]
    rest = 1.0 - share
    line = now + share * (then - now)
    bent = (then - now + row * motion[before, 2]) * share - (then - now + row * motion[k, 2]) * rest
    return float(line + share * rest * bent)


@compiled
def along_row(w: Floats, motion: Floats, k: int, j: float, parts: int) -> None:
    """Put the wires to the end of part `j` (less a half: its middle) of `parts` of row `k` of a motion.

    `motion` is (K, 5): time (s), position (m), velocity, acceleration, the command held up to each row (V).
    """
    before = max(k - 1, 0)
    share = 1.0 - j / parts
    w[TIME] = motion[k, 0] + share * (motion[before, 0] - motion[k, 0])
    w[STEP] = (motion[k, 0] - motion[before, 0]) / parts
    w[POSITION] = between_rows(motion, k, share)
    w[MOVED] = w[POSITION] - between_rows(motion, k, share + 1.0 / parts)
    w[VELOCITY] = motion[k, 2] + share * (motion[before, 2] - motion[k, 2])
    w[ACCELERATION] = motion[k, 3]
    w[VOLTS] = motion[k, 4]


@compiled
def _along(
    steps: np.ndarray, p: Floats, s: Floats, w: Floats, base: Floats, motion: Floats, parts: int, fast: bool,
    middle: bool, ends: bool, out: Floats,
) -> None:  # fmt: skip
    """Fill `out`: the mean of the drive's force over the row's parts, the rest as it is at the row's end.

    And the weighed means of the drive's force; of the others' where effects change so `fast`, within a row.
    A part's drive force is that at its end or its middle, or the mean of both `ends`.
    """
    last = driven = 0.0
    for k in range(motion.shape[0]):
        drive = 0.0
        for j in range(1, parts + 1):
            along_row(w, motion, k, j - 0.5 if middle else float(j), parts)
            renew(w, base[0], base[1])
            run_chain(steps, p, s, w, 0, steps[0])
            before = driven if ends and k > 0 else w[DRIVE]
            driven = w[DRIVE]
            passed, force = (j - 0.5) / parts, 0.5 * (before + driven) / parts
            drive += force
            out[6, k] += force * passed
            out[7, k] += force * (1.0 - passed)
            if fast:
                # Forces are those at the end of a part: over it, the mean of both its ends.
                now = w[PUSH] - w[FRICTION]
                share = 0.5 * (last + now) / parts
                last = now
                out[4, k] += share * passed
                out[5, k] += share * (1.0 - passed)
        if middle:
            along_row(w, motion, k, float(parts), parts)
            renew(w, base[0], base[1])
            run_chain(steps, p, s, w, 0, steps[0])
        out[0, k], out[1, k], out[2, k], out[3, k] = drive, w[PUSH], w[FRICTION], w[MASS]


def known_force(
    stage: Stage, time: Floats, position: Floats, velocity: Floats, *, viscous: bool = True
) -> Floats:
    """Return the drive force (N, (K,)) that a motion needs beside hysteresis and inertia.

    That is everything the stage knows of but the friction model: micro-damping, cogging, springs ... With
    `viscous` false, without the stage file's viscous friction too.
    """
    left_out = {id(e) for e in stage.chain if e.place is Place.FRICTION and e == stage.friction}
    chain = [e for e in stage.chain if id(e) not in left_out]
    zero = np.zeros_like(position)
    f = forces(stage, chain, time, position, velocity, zero, zero)
    needed = f.friction - f.push - f.drive
    return needed if viscous else needed - stage.mechanics.viscous * velocity


def bandwidth(rate_hz: float) -> float:
    """Return the bandwidth (Hz) of a comparison unless told: a tenth of the rate, at most 100 Hz."""
    return min(0.1 * rate_hz, 100.0)


def force_balance(
    stage: Stage, time: Floats, position: Floats, voltage: Floats, bandwidth_hz: float | None = None
) -> Balance:
    """Return both sides of the balance on a recording: rows equally spaced, voltage held from row to row.

    The force around a row is weighed over the rows before and after it, as the second difference of position
    weighs the accelerations. Friction's memory and the acceleration come from the position as it was
    measured, the velocity from below three times `bandwidth_hz`, and both sides are compared below it,
    forward and backward filtered: no delay. What the stage's sensor does to a reading is undone first.
    """
    return balance_along(stage, time, true_position(stage.chain, time, position), voltage, bandwidth_hz)


def balance_along(
    stage: Stage, time: Floats, position: Floats, voltage: Floats, bandwidth_hz: float | None = None
) -> Balance:
    """Return `force_balance` along a `position` (m) that is the true one, whatever the sensor does."""
    period = float((time[-1] - time[0]) / (time.size - 1))
    cut = bandwidth(1.0 / period) if bandwidth_hz is None else bandwidth_hz
    slow = zero_phase(position, min(3.0 * cut, 0.4 / period), 1.0 / period)
    velocity = np.gradient(slow, period)
    # Not smoothed twice: the comparison below takes out what noise adds above the bandwidth.
    acceleration = np.zeros_like(position)
    acceleration[1:-1] = (position[2:] - 2 * position[1:-1] + position[:-2]) / period**2
    grain = 1.5 * stage.sensor.noise + 0.5 * stage.sensor.resolution
    drive = [e for e in stage.chain if e.place is Place.DRIVE]
    held = np.append(voltage[:1], voltage[:-1])
    motion = forces(stage, stage.chain, time, position, velocity, acceleration, held, grain)
    needed = motion.mass * acceleration - motion.others()
    parts = parts_of_drive(drive)
    given = forces(stage, drive, time, position, velocity, acceleration, held, parts=parts).held_drive()
    return Balance(zero_phase(given, cut, 1.0 / period), zero_phase(needed, cut, 1.0 / period), cut)


def around_rows(force: Floats) -> Floats:
    """Return the mean of a smooth force (N, (K,) or (K, p)) around each row, as second differences see it.

    The second difference weighs accelerations by a triangle from the row before to the row after; so weighed,
    a force that is smooth between rows is (F[k-1] + 10 F[k] + F[k+1]) / 12 (Numerov 1924), right to the
    fourth order. At a tenth of the rate the middle value alone would be 3 % too large.
    """
    mean = np.array(force, order="C")
    _around(mean.reshape(mean.shape[0], -1))
    return mean


@compiled
def _around(x: Floats) -> None:
    """Replace all rows of `x`, (K, p), but the first and last, in one pass."""
    rows, columns = x.shape
    before = x[0].copy()
    for k in range(1, rows - 1):
        for j in range(columns):
            now = x[k, j]
            x[k, j] = (before[j] + 10.0 * now + x[k + 1, j]) / 12.0
            before[j] = now


def zero_phase(signal: Floats, cutoff_hz: float, rate_hz: float) -> Floats:
    """Low-pass `signal`, (K,) or (K, p), without delay: a second-order Butterworth forward and backward."""
    return lowpass.zero_phase(signal, cutoff_hz, rate_hz)
