"""Feedforward from a stage's whole chain: the command that makes it follow a reference, tick by tick.

The chain is run backwards. The sensor is undone, so that it is the reading that follows; along that motion
the stage's own kernels give the force that is needed,

    force_drive = m a + friction - push,

and the drive is undone: what loses force is made up for, gains divided by, dead bands jumped over, lags and
delays led. Known beforehand, it costs the tick nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rtcomp.control.following_on import FollowingOn
from rtcomp.control.references import Reference
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.plan import HOLD
from rtcomp.kernels import Floats
from rtcomp.physics import Effect, Place
from rtcomp.physics.drive import FORCE_ORDER
from rtcomp.physics.rows import new_rows, over_rows
from rtcomp.physics.wires import GAIN, POSITION, SENSED, TIME, VOLTS
from rtcomp.stage.balance import forces
from rtcomp.stage.inverse import undone
from rtcomp.stage.stage import Stage

BY_CLOCK = frozenset({"tonal-disturbance", "friction-drift", "sensor-drift", "sensor-jump"})
"""Effects that go by the time since the stage started, which only a simulation shares with the loop."""
NOTHING = HysteresisModel(IntervalBasis([1.0]), np.zeros(1))
"""The model of a tick whose plan holds the whole feedforward."""
_UNSTEADY = frozenset({"sensor-jump"})
"""What no motion follows: a reading that jumps asks for infinite force."""
_PASSES = 8
"""Rounds in which a load and the friction that grows with it find each other."""
_LEAST_GAIN = 1e-2
"""Share of the force constant below which a place is taken to have this much."""


def lead_volts(
    stage: Stage,
    reference: Reference | FollowingOn,
    period: float,
    ticks: int,
    delay_ticks: int = 0,
    *,
    clock: bool = True,
) -> Floats:
    """Return the command (V, (ticks,)) of each tick with which `stage` follows `reference`, from rest.

    Friction remembers the motion before time zero, if there is one (`FollowingOn`).

    A tick is `period` (s); a command takes effect `delay_ticks` after the tick it is computed at and is held
    for one. With `clock` false what goes by the time since the stage's start (`BY_CLOCK`) is left out: a real
    stage started at another time than the loop.
    """
    dropped = _UNSTEADY if clock else _UNSTEADY | BY_CLOCK
    chain = [e for e in stage.chain if e.name not in dropped]
    sensor = [e for e in chain if e.place is Place.SENSOR]
    drive = [e for e in chain if e.place is Place.DRIVE and e.order < FORCE_ORDER]
    body = [e for e in chain if e.place is not Place.SENSOR and e not in drive]
    ahead = delay_ticks * period + held(drive, period) + _total(drive, "drive-delay")
    rows = math.ceil((ahead + reference.earlier) / period - 1e-9)  # at rest first, where memory begins
    acts: Floats = np.arange(-rows, ticks, dtype=np.float64) * period + ahead
    motion = _true_motion(sensor, reference, acts, period)
    volts = _needed(stage, body, acts, *motion) / stage.force_constant
    return _commanded(drive, acts, motion[0], volts, stage.voltage_limit)[rows:]


def held(drive: Sequence[Effect], period: float) -> float:
    """Return after what time (s) of its tick a command, held for `period`, acts as its lag ends the tick.

    Without a lag half a tick: the mean of what is held. The inverse of a lag makes its output right at the
    end of the tick; the mean over the tick belongs to an earlier moment, by one less the share 1 / (1 -
    exp(-u)) - 1 / u of a tick, u = period / time constant: half a tick of a slow lag, nothing of a fast one.
    """
    ticks = HOLD
    for effect in drive:
        if effect.name == "drive-lag" and effect.values["time_constant"] > 0.0:
            u = period / effect.values["time_constant"]
            ticks += 1.0 - (1.0 / -math.expm1(-u) - 1.0 / u if u > 1e-3 else 0.5 + u / 12.0)
    return ticks * period


def _total(effects: Sequence[Effect], name: str) -> float:
    return sum(e.values["delay"] for e in effects if e.name == name)


def _true_motion(
    sensor: Sequence[Effect], reference: Reference | FollowingOn, acts: Floats, period: float
) -> tuple[Floats, Floats, Floats]:
    """Return position, velocity and acceleration of the stage whose reading follows the reference."""
    read = acts + _total(sensor, "sensor-delay")
    undo = [e for e in sensor if e.inverse is not None]
    if not undo:
        return reference.evaluate(read)
    h = 0.5 * period

    def true(at: Floats) -> Floats:
        signal = reference.evaluate(at)[0]
        for effect in reversed(undo):
            signal = undone(effect, at, signal, SENSED)
        return signal

    earlier, x, later = true(read - h), true(read), true(read + h)
    return x, (later - earlier) / (2.0 * h), (later - 2.0 * x + earlier) / h**2


def _needed(
    stage: Stage, body: list[Effect], time: Floats, position: Floats, velocity: Floats, acceleration: Floats
) -> Floats:
    """Return the force (N, (K,)) that the voltage has to give, the drive's own losses included."""
    given = np.zeros_like(position)
    rounds = _PASSES if any(e.name == "load-dependent-friction" for e in body) else 1
    for _ in range(rounds):
        f = forces(stage, body, time, position, velocity, acceleration, given / stage.force_constant)
        given = f.mass * acceleration + f.friction - f.push - (f.drive - given)
    return given


def _commanded(
    drive: Sequence[Effect], time: Floats, position: Floats, volts: Floats, limit: float
) -> Floats:
    """Return the command (V, (K,)) that comes out of the drive as `volts`, of the believed force constant."""
    rows = new_rows(time.size)
    rows[:, TIME], rows[:, POSITION] = time, position
    volts = volts / np.maximum(over_rows(drive, rows)[:, GAIN], _LEAST_GAIN)
    for effect in reversed(drive):
        if effect.inverse is not None:
            volts = undone(effect, time, volts, VOLTS)
        elif effect.name == "drive-saturation":
            volts = np.clip(volts, -effect.values["limit"], effect.values["limit"])
    return np.clip(volts, -limit, limit)
