"""A stage let go from points of a recorded motion: short simulations, each from where the recording was.

Up to its start the chain is led along the recorded motion, so that friction, delays and everything else that
remembers has the memory of that motion (in steps that what swings by itself bears, as a load on its contact);
from there it runs free, driven by the recorded command. What it moves off by is an error of position that no
controller hides, and that a missed break-away spoils for one window only (multiple shooting: Bock 1981; van
Domselaar, Hemker 1975).
"""

from __future__ import annotations

import math

import numpy as np

from rtcomp.errors import ConfigError
from rtcomp.kernels import Floats, compiled
from rtcomp.physics import Place, wires
from rtcomp.physics.program import COUNT, Program, renew, run_chain
from rtcomp.physics.wires import (
    ACCELERATION,
    DRIVE,
    FRICTION,
    MASS,
    MOVED,
    POSITION,
    PUSH,
    STEP,
    TIME,
    VELOCITY,
    VOLTS,
)  # fmt: skip
from rtcomp.stage.simulate import MOST_IN_ALL, integrate, largest_step, largest_stiffness
from rtcomp.stage.stage import Stage

WIDER = 2.0
"""Times as far as a recorded motion went, within which one simulated along it is taken to stay."""


def shoot(
    stage: Stage,
    time: Floats,
    position: Floats,
    velocity: Floats,
    voltage: Floats,
    starts: np.ndarray,
    rows: int,
    coarse: float = 1.0,
) -> Floats:
    """Return positions (m, (starts, rows)) simulated from each row of `starts` on, `rows` rows long.

    The recorded motion is `time` (s, equally spaced), true `position` (m), `velocity` (m/s) and `voltage` (V,
    held from row to row), each (K,). Every start must leave `rows` rows; the first position of each is the
    recorded one. Sensors are left out. Steps are `coarse` times as long as in a simulation, where speed
    counts for more than the last digits. Raises ConfigError where that asks for more than MOST_IN_ALL.
    """
    starts = np.sort(np.asarray(starts, dtype=np.int64))
    if rows < 1 or (starts.size and (starts[0] < 0 or starts[-1] + rows > time.size)):
        raise ValueError(f"windows of {rows} rows from {starts} do not lie within {time.size} rows")
    moving = [e for e in stage.chain if e.place is not Place.SENSOR]
    program = Program(moving)
    period = float((time[-1] - time[0]) / max(time.size - 1, 1))
    stroke = WIDER * float(np.abs(position).max(initial=0.0))
    count = max(1, math.ceil(period / (coarse * largest_step(stage, stroke)) - 1e-9))
    longest = min((e.longest_step() for e in moving), default=math.inf)
    led = max(1, math.ceil(period / longest - 1e-9))
    if starts.size * rows * count + time.size * led > MOST_IN_ALL:
        raise ConfigError(
            f"the stage cannot be simulated in reasonable time: {starts.size} windows of {rows} rows need "
            f"{count} steps a row, all together at most {MOST_IN_ALL:g}"
        )
    base = np.array([stage.mass, stage.force_constant, largest_stiffness(stage, stroke), 0.0])
    motion = np.ascontiguousarray(np.column_stack([time, position, velocity, voltage]))
    out = np.empty((starts.size, rows))
    w = np.zeros(wires.COUNT)
    _shoot(program.steps, program.p, program.s, w, base, motion, starts, period, led, count, out)
    return out


@compiled
def _shoot(
    steps: np.ndarray,
    p: Floats,
    s: Floats,
    w: Floats,
    base: Floats,
    motion: Floats,
    starts: np.ndarray,
    period: float,
    led: int,
    count: int,
    out: Floats,
) -> None:
    """Lead the chain along `motion`, `led` steps from row to row, and let it go at `starts`; fill `out`."""
    window = 0
    for k in range(motion.shape[0]):
        if window >= starts.size:
            break
        last = max(k - 1, 0)
        gone = motion[k] - motion[last]
        w[STEP] = gone[0] / led
        w[ACCELERATION] = gone[2] / period
        for i in range(1, led + 1):
            part = (led - i) / led
            w[TIME] = motion[k, 0] - part * gone[0]
            w[POSITION], w[VELOCITY] = motion[k, 1] - part * gone[1], motion[k, 2] - part * gone[2]
            w[MOVED] = gone[1] / led
            w[VOLTS] = motion[last, 3]
            renew(w, base[0], base[1])
            run_chain(steps, p, s, w, 0, steps[COUNT])
        while window < starts.size and starts[window] == k:
            free, wires_free, base_free = s.copy(), w.copy(), base.copy()
            wires_free[STEP] = wires_free[MOVED] = 0.0
            wires_free[VOLTS] = motion[k, 3]
            renew(wires_free, base[0], base[1])
            run_chain(steps, p, free, wires_free, 0, steps[COUNT])
            force = wires_free[DRIVE] + wires_free[PUSH] - wires_free[FRICTION]
            wires_free[ACCELERATION] = force / wires_free[MASS]
            for i in range(out.shape[1]):
                out[window, i] = wires_free[POSITION]
                if i + 1 < out.shape[1]:
                    integrate(steps, p, free, wires_free, base_free, motion[k + i, 3], period, count)
            window += 1
