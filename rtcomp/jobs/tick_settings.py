"""What the tick is told of the axis and of what it may do, from a configuration."""

from __future__ import annotations

import math

from rtcomp.hysteresis.rls import Rls
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.limit_settings import STUCK_S, contradictions, flicker
from rtcomp.loop.tick import TickSettings

SIGN_S, SIGN_TICKS = 5e-3, 8
"""s and ticks, at least, of each of the two windows in which a driven axis must not run against its drive."""
FULL_DRIVE = 0.98
"""Of the voltage limit: what counts as driven with all there is."""
SLOTS_LOST = 20
"""Slots lost after which a loop stops, unless told."""
MOST_FORCE = 10.0
"""Times what the drive can give at most: a model that says more has diverged."""

MOST_WITH_RLS, MOST_WITH_PRIOR = 5000, 1000
"""Elements: RLS keeps a square of them, 0.2 GB at the most; the prior's least squares take their cube."""


def check_size(config: Configuration, size: int) -> None:
    """Raise ConfigError where so many elements would take more memory or time than anybody has."""
    section = config.run.identify
    if section is None:
        return
    key = ("identify", "intervals" if section.widths is None else "widths")
    if size > MOST_WITH_RLS and section.learner.get("learner") == Rls.name:
        raise config.file.error(
            key,
            f"{size} elements are too many for the learner rls, which keeps {size} times {size} numbers; "
            f"take at most {MOST_WITH_RLS}, or the learner nlms",
        )
    if size > MOST_WITH_PRIOR and section.prior != "none":
        raise config.file.error(
            key,
            f"{size} elements are too many for identify.prior; take at most {MOST_WITH_PRIOR}, or prior none",
        )


def tick_settings(config: Configuration, delay_ticks: int, closed_loop: bool) -> TickSettings:
    """Return the settings of a tick. In open loop nothing is checked: the positions are what they were.

    Whether the axis follows its drive is checked on real devices, and in simulation where the section
    ``limits`` says so. Raises ConfigError for limits that a closed loop could not keep.
    """
    stage, section = config.stage, config.run.identify
    axis = TickSettings(
        period=config.period,
        force_constant=stage.force_constant,
        mass=stage.mass,
        viscous=stage.mechanics.viscous,
        gate=section.gate if section is not None else 0.0,
        delay_ticks=delay_ticks,
        closed_loop=closed_loop,
    )
    if not closed_loop:
        return axis
    limits, loop = config.run.limits, config.run.loop
    for key, says in contradictions(limits, stage, config.run.device):
        raise config.file.error(key, says)
    travel = limits.travel or [-math.inf, math.inf]
    stuck = limits.stuck or (STUCK_S if config.real_device else math.inf)
    asked = config.real_device or limits.stuck is not None or limits.moves_at is not None
    drive = (limits.moves_at or FULL_DRIVE * config.voltage_limit) if asked else math.inf
    return axis._replace(
        travel=(travel[0], travel[1]),
        speed=10.0 * (limits.speed or math.inf),
        jump=limits.jump or math.inf,
        one_count=flicker(stage),
        stuck_volts=drive,
        stuck_ticks=math.ceil(stuck / config.period) if math.isfinite(stuck) else math.inf,
        sign_volts=drive,
        sign_ticks=max(SIGN_TICKS, round(SIGN_S / config.period)),
        age_ticks=math.ceil(limits.age / config.period - 1e-9),
        invalid_ticks=math.floor(limits.invalid / config.period + 1e-9),
        late=loop.late,
        slots_lost=SLOTS_LOST if loop.slots_lost is None else loop.slots_lost,
        device_paced=loop.overrun == "device-paced",
        force_bound=MOST_FORCE * stage.force_constant * stage.voltage_limit,
    )
