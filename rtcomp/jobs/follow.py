"""The loop along a reference, from a known past: a real axis is relaxed first, let go, then followed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rtcomp.control.following_on import FollowingOn
from rtcomp.control.references import Reference
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.arming import permit
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.lead import NOTHING, lead_volts
from rtcomp.jobs.plan import HOLD, ReferencePlan
from rtcomp.jobs.session import Run, Watch, make_device, make_tick, run_loop
from rtcomp.kernels import Floats
from rtcomp.loop.device import Armable, Device
from rtcomp.loop.tick import Tick
from rtcomp.stage.stage import Stage


@dataclass(frozen=True)
class _Fed:
    """What is fed forward, of a `model` or of a whole `stage`, if anything is."""

    config: Configuration
    device: Device
    model: HysteresisModel | None
    stage: Stage | None
    feeds: bool
    """Whether it is fed forward at all."""

    def plan(self, way: Reference | FollowingOn, let_go: float = 0.0) -> ReferencePlan:
        """Return the plan for the reference of `way`, at whose end the axis is let go within `let_go` (s)."""
        reference = way.now if isinstance(way, FollowingOn) else way
        period, delay = self.config.period, self.device.delay_ticks
        ticks = max(16, round((reference.duration + let_go) * self.config.stage.rate))
        plan = ReferencePlan(reference, self.config.stage, period, ticks, delay, let_go=let_go)
        if self.stage is None:
            return plan
        clock = not self.config.real_device
        return replace(plan, lead=lead_volts(self.stage, way, period, ticks, delay, clock=clock))

    def tick(self, way: Reference | FollowingOn) -> Tick:
        """Return the tick; what it feeds forward remembers the motion before that of `way`."""
        period, delay = self.config.period, self.device.delay_ticks
        tick = make_tick(self.config, delay, self.model)
        if self.feeds and way.earlier > 0.0:
            before: Floats = np.arange(-math.ceil(way.earlier / period), 0, dtype=np.float64)
            tick.remember(way.evaluate((before + delay + HOLD) * period)[0])
        return tick


def follow(
    config: Configuration,
    section: str,
    *,
    learn: tuple[float, float] | None = None,
    model: HysteresisModel | None = None,
    stage: Stage | None = None,
    feedforward_from: float | None = None,
    feedforward_fade: float = 0.0,
    path: Path | None = None,
    watch: Watch | None = None,
    partial: bool = False,
) -> Run:
    """Run the loop along the reference of `section` to its end, with or without learning and feedforward.

    With `stage` the whole feedforward is that stage's (`lead.lead_volts`) in place of the model's. A real
    device is relaxed first, with the same fed forward, let go, and followed from where it stands; what is fed
    forward remembers what that did. `partial` as `run_loop` takes it.
    """
    device = make_device(config)
    feeds = feedforward_from is not None
    fed = _Fed(config, device, model if stage is None else NOTHING, stage, feeds)
    way: Reference | FollowingOn
    if not config.real_device:
        way = config.reference(section)
    else:
        start = where_it_stands(device)
        way = config.reference(section, start)  # refuse what cannot be followed before anything moves
        permit(config, device, start, way)
        relaxing = config.relaxing(start)
        if relaxing is not None:
            # Feedback alone would lose the last reversals: they are smaller than its error.
            reversals, let_go = relaxing
            plan = replace(fed.plan(reversals, let_go), feedforward_from=0.0 if feeds else None)
            run_loop(config, plan, device, fed.tick(reversals))
            way = FollowingOn(reversals, config.reference(section, where_it_stands(device)), let_go)
    plan = replace(
        fed.plan(way),
        learn=learn,
        feedforward_from=feedforward_from,
        feedforward_fade=feedforward_fade,
    )
    return run_loop(config, plan, device, fed.tick(way), path=path, watch=watch, partial=partial)


def where_it_stands(device: Device) -> float:
    """Open the device, ask for its position (m), close it. Raises DeviceError.

    Where the device can be looked at, nothing is armed for that.
    """
    device.open()
    try:
        return (device.look() if isinstance(device, Armable) else device.exchange(0.0)).position
    finally:
        device.close()
