"""Both sides of a stage's force balance, on recorded or planned motion.

    mass * acceleration = force_drive - friction + other forces

The drive side is what the voltage produced, the motion side what the motion needed; a stage that is right
has them equal. The same kernels as in simulation are run over the rows of a motion, so memory (hysteresis)
starts relaxed at the first row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.physics import Effect, Place, wires
from rtcomp.physics.wires import (
    ACCELERATION,
    DRIVE,
    FRICTION,
    GAIN,
    MASS,
    MOVED,
    POSITION,
    PUSH,
    REACH,
    SCALE,
    STEP,
    TIME,
    VELOCITY,
    VOLTS,
)  # fmt: skip
from rtcomp.stage.simulate import Program, run_chain
from rtcomp.stage.stage import Stage


@dataclass(frozen=True)
class Forces:
    """Forces along a motion, each (K,), N; and the moving mass, kg."""

    drive: Floats
    push: Floats
    friction: Floats
    mass: Floats


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
) -> Forces:
    """Run the effects `chain` along a motion; all arrays (K,), equally spaced in time, SI units."""
    program = Program([e for e in chain if e.place is not Place.SENSOR])
    out = np.empty((4, time.size))
    motion = np.ascontiguousarray(np.column_stack([time, position, velocity, acceleration, volts]))
    base = np.array([stage.mass, stage.force_constant])
    _along(program.steps, program.p, program.s, np.zeros(wires.COUNT), base, motion, out)
    return Forces(*out)


@compiled
def _along(
    steps: np.ndarray, p: Floats, s: Floats, w: Floats, base: Floats, motion: Floats, out: Floats
) -> None:
    for k in range(motion.shape[0]):
        before = max(k - 1, 0)
        w[TIME] = motion[k, 0]
        w[STEP] = motion[k, 0] - motion[before, 0]
        w[POSITION] = motion[k, 1]
        w[MOVED] = motion[k, 1] - motion[before, 1]
        w[VELOCITY] = motion[k, 2]
        w[ACCELERATION] = motion[k, 3]
        w[VOLTS] = motion[k, 4]
        w[MASS], w[GAIN] = base[0], base[1]
        w[DRIVE] = w[PUSH] = w[FRICTION] = 0.0
        w[REACH] = w[SCALE] = 1.0
        run_chain(steps, p, s, w, 0, steps[0])
        out[0, k], out[1, k], out[2, k], out[3, k] = w[DRIVE], w[PUSH], w[FRICTION], w[MASS]


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

    The force around a row is the mean of those before and after it, as the second difference of position
    is of the accelerations. Velocity and acceleration come from the position below `bandwidth_hz` (forward
    and backward filtered: no delay), the friction's memory from the position as it was measured, and both
    sides are compared below the same bandwidth.
    """
    period = float((time[-1] - time[0]) / (time.size - 1))
    cut = bandwidth(1.0 / period) if bandwidth_hz is None else bandwidth_hz
    slow = zero_phase(position, cut, 1.0 / period)
    velocity = np.gradient(slow, period)
    acceleration = np.zeros_like(slow)
    acceleration[1:-1] = (slow[2:] - 2 * slow[1:-1] + slow[:-2]) / period**2
    held = np.append(voltage[:1], voltage[:-1])
    drive = [e for e in stage.chain if e.place is Place.DRIVE]
    rest = [e for e in stage.chain if e.place is not Place.DRIVE]
    before = forces(stage, drive, time, position, velocity, acceleration, held).drive
    after = forces(stage, drive, time, position, velocity, acceleration, voltage).drive
    motion = forces(stage, rest, time, position, velocity, acceleration, voltage)
    needed = motion.mass * acceleration + motion.friction - motion.push
    given = 0.5 * (before + after)
    return Balance(zero_phase(given, cut, 1.0 / period), zero_phase(needed, cut, 1.0 / period), cut)


def zero_phase(signal: Floats, cutoff_hz: float, rate_hz: float) -> Floats:
    """Low-pass `signal` (K,) without delay: a second-order Butterworth forward and backward."""
    from scipy.signal import butter, sosfiltfilt

    return np.asarray(sosfiltfilt(butter(2, cutoff_hz, fs=rate_hz, output="sos"), signal), dtype=np.float64)
