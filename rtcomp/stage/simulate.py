"""A stage simulated: the chain of effects integrated in time, open loop, command held between calls.

Leapfrog with velocity-dependent forces at a predicted velocity: second order, and stop elements are
integrated exactly over each displacement, so stiffness bounds only the resolution of oscillations. The step
is chosen from the chain's largest stiffness K and damping C: h <= 0.03 sqrt(m / K) and h <= 0.1 m / C.

Stuck on undamped contacts a stage rings for hundreds of cycles, in which plain leapfrog would run ahead by
(h omega)^2 / 24 of each. Its impulses are therefore scaled by sinc^2(h omega / 2), with omega from the
tangent stiffness of the step before, which makes it exact for any linear oscillation (Gautschi 1961).
"""

from __future__ import annotations

import math

import numpy as np

from rtcomp.kernels import Floats, compiled
from rtcomp.physics import Place, wires
from rtcomp.physics.program import COUNT, DRIVES, Program, renew, run_chain
from rtcomp.physics.wires import (
    ACCELERATION,
    DRIVE,
    FRICTION,
    GAIN,
    MASS,
    MOVED,
    NOISE,
    POSITION,
    PUSH,
    REACH,
    SCALE,
    SENSED,
    STEP,
    TIME,
    VELOCITY,
    VOLTS,
)  # fmt: skip
from rtcomp.stage.stage import Stage

MOST_IN_ALL = 20_000_000
"""Steps along all rows of a recording, beyond which a simulation that a fit asks for is not begun: of what is
so stiff, or so damped on so little mass, no row tells, and it would take minutes. Usual are a million."""


@compiled
def impulse_scale(tangent: float, mass: float, h: float) -> float:
    """Return sinc^2(h omega / 2) for omega = sqrt(tangent / mass), which is near 1."""
    y = tangent * h * h / mass
    return 1.0 - y / 12.0 + y * y / 360.0


@compiled
def integrate(
    steps: np.ndarray, p: Floats, s: Floats, w: Floats, base: Floats, volts: float, seconds: float, count: int
) -> None:
    """Advance the wires `w` and states `s` by `count` steps of together `seconds`, `volts` held.

    A drive that changes within a step (a late command) states the mean of its force over that: its impulse is
    that mean's, and what acts at the end goes on into the next step.

    base: mass (kg), force constant (N/V), largest stiffness (N/m), and the tangent stiffness of the last
    step (N/m), which is kept there.
    """
    h = seconds / count
    stiffest, tangent = base[2], base[3]
    effects, drives = steps[COUNT], steps[DRIVES]
    # The new command acts from the first instant: exchange the drive's share of the acceleration. What drives
    # push by themselves, as magnets do, is there already.
    before, push = w[DRIVE], w[PUSH]
    w[STEP] = 0.0
    w[VOLTS] = volts
    w[GAIN] = base[1]
    w[DRIVE] = 0.0
    run_chain(steps, p, s, w, 0, drives)
    driven, w[PUSH] = w[DRIVE], push
    a = w[ACCELERATION] + (driven - before) / w[MASS]
    w[STEP] = h
    x, v = w[POSITION], w[VELOCITY]
    elastic = w[FRICTION] - w[PUSH]
    kick = 0.5 * h * a * impulse_scale(tangent, w[MASS], h)
    for _ in range(count):
        half = v + kick
        moved = h * half
        w[MOVED] = moved
        x += moved
        w[TIME] += h
        w[POSITION] = x
        w[VELOCITY] = half + kick  # predicted; corrected below
        w[ACCELERATION] = a
        w[VOLTS] = volts
        renew(w, base[0], base[1])
        run_chain(steps, p, s, w, 0, effects)
        mean, push, within = w[DRIVE], w[PUSH], 0.0
        w[STEP], w[VOLTS], w[GAIN], w[DRIVE] = 0.0, volts, base[1], 0.0
        run_chain(steps, p, s, w, 0, drives)
        w[STEP], w[PUSH] = h, push
        if w[DRIVE] != mean:
            within = mean - 0.5 * (driven + w[DRIVE])
        driven = w[DRIVE]
        a = (w[DRIVE] + w[PUSH] - w[FRICTION]) / w[MASS]
        if moved != 0.0:
            # Damping near a turning point can make this anything; outside these bounds it is no stiffness.
            tangent = min(max((w[FRICTION] - w[PUSH] - elastic) / moved, 0.0), stiffest)
        elastic = w[FRICTION] - w[PUSH]
        kick = 0.5 * h * a * impulse_scale(tangent, w[MASS], h)
        v = half + kick + h * within / w[MASS]
    w[VELOCITY] = v
    w[ACCELERATION] = a
    base[3] = tangent


@compiled
def _rest(steps: np.ndarray, p: Floats, s: Floats, w: Floats, base: Floats) -> None:
    """Find the acceleration at the start, at rest and without command: springs and weight pull already."""
    w[GAIN] = base[1]
    run_chain(steps, p, s, w, 0, steps[COUNT])
    w[ACCELERATION] = (w[DRIVE] + w[PUSH] - w[FRICTION]) / w[MASS]


class Simulator:
    """A stage in motion. Starts at rest at `start` (m), friction relaxed.

    `substeps` multiplies the number of integration steps (to check that they suffice).
    """

    def __init__(self, stage: Stage, seed: int = 0, substeps: float = 1.0, start: float = 0.0) -> None:
        self.stage = stage
        moving = [e for e in stage.chain if e.place is not Place.SENSOR]
        self._moving, self._moving_start = Program(moving), Program(moving)
        sensing = [e for e in stage.chain if e.place is Place.SENSOR]
        self._sensing, self._sensing_start = Program(sensing), Program(sensing)
        stiffness = largest_stiffness(stage)
        self._base = np.array([stage.mass, stage.force_constant, stiffness, 0.0])
        self.step = largest_step(stage) / substeps
        self._seed, self._start = seed, start
        self.reset()

    def reset(self) -> None:
        """Put everything back to the start, the noise too."""
        self._moving.s[:] = self._moving_start.s
        self._sensing.s[:] = self._sensing_start.s
        self._w: Floats = np.zeros(wires.COUNT)
        self._w[MASS] = self.stage.mass
        self._w[POSITION] = self._start
        self._w[REACH] = self._w[SCALE] = 1.0
        self._base[3] = 0.0
        _rest(self._moving.steps, self._moving.p, self._moving.s, self._w, self._base)
        self._random = np.random.default_rng(self._seed)
        self._noise = self._random.standard_normal(4096)
        self._drawn = 0

    def advance(self, volts: float, seconds: float) -> None:
        """Integrate over `seconds` with the command `volts` (V) held."""
        count = max(1, math.ceil(seconds / self.step - 1e-9))
        m = self._moving
        integrate(m.steps, m.p, m.s, self._w, self._base, volts, seconds, count)

    def measure(self) -> float:
        """Return the position (m) as the sensor sees it now; each call is a new measurement."""
        w, program = self._w, self._sensing
        if self._drawn == self._noise.size:
            self._random.standard_normal(out=self._noise)
            self._drawn = 0
        w[NOISE] = self._noise[self._drawn]
        self._drawn += 1
        w[SENSED] = w[POSITION]
        _sense(program.steps, program.p, program.s, w)
        return float(w[SENSED])

    @property
    def position(self) -> float:
        """True position (m)."""
        return float(self._w[POSITION])

    @property
    def velocity(self) -> float:
        """True velocity (m/s)."""
        return float(self._w[VELOCITY])

    @property
    def friction(self) -> float:
        """Friction at the last step (N), opposing motion."""
        return float(self._w[FRICTION])

    @property
    def time(self) -> float:
        """Simulated time (s)."""
        return float(self._w[TIME])


@compiled
def _sense(steps: np.ndarray, p: Floats, s: Floats, w: Floats) -> None:
    run_chain(steps, p, s, w, 0, steps[COUNT])


def largest_stiffness(stage: Stage, stroke: float | None = None) -> float:
    """Return the largest stiffness (N/m) that the whole chain can put on the mass.

    With `stroke` (m), the largest within that distance of position zero.
    """
    own = [e.stiffness() if stroke is None else e.stiffness_within(stroke) for e in stage.chain]
    return sum(own) + sum(stage.mass * e.frequency() ** 2 for e in stage.chain)


def largest_step(stage: Stage, stroke: float | None = None) -> float:
    """Return the longest integration step (s) that resolves stiffness (within `stroke`, m) and damping.

    Damping that grows with the speed is that of the fastest motion which the drive alone can hold.
    """
    stiffness = largest_stiffness(stage, stroke)
    most = stage.force_constant * stage.voltage_limit
    damping = sum(e.damping_under(most) + stage.mass * e.frequency() for e in stage.chain)
    step = min(1.0 / stage.rate, *(e.longest_step() for e in stage.chain))
    if stiffness > 0:
        step = min(step, 0.03 * math.sqrt(stage.mass / stiffness))
    if damping > 0:
        step = min(step, 0.1 * stage.mass / damping)
    return step
