"""Lateness of the real loop, with identifier, compensator and recorder, beside cyclictest and plain Python.

The three take turns in short stretches, so that what else the machine does meets all of them alike.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rtcomp.bench import cyclictest, plain
from rtcomp.bench.spread import Floats, Spread, ratio
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.identify import ALWAYS
from rtcomp.jobs.plan import ReferencePlan
from rtcomp.jobs.session import Run, make_device, make_tick, run_loop

STRETCH_S = 2.0
"""s of one runner before the next has its turn."""
LOST = 2.0
"""What the column ``overrun`` holds for a slot that passed altogether."""
RUNNERS = ("loop", "cyclictest", "plain Python")


@dataclass(frozen=True)
class Measured:
    """What one runner did at one rate, all stretches together."""

    spread: Spread
    period_us: float

    @property
    def missed(self) -> int:
        """Slots that passed altogether."""
        return self.spread.missed(self.period_us)

    def to_json(self) -> dict[str, Any]:
        """Return wake-ups, percentiles (us) and missed slots."""
        return {"wake_ups": self.spread.total, **self.spread.figures(), "missed": self.missed}


@dataclass(frozen=True)
class AtRate:
    """The runners at one rate."""

    rate_hz: float
    runners: Mapping[str, Measured]
    """By name, of `RUNNERS`; cyclictest only where it is installed."""
    execution: Spread
    """How long the loop's ticks took, us."""
    realtime: Mapping[str, str]
    """What was in force while the loop ran."""
    stretches: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    """Slots missed in each stretch, by runner."""

    def by_chance(self, rival: str, draws: int = 4000) -> tuple[float, float]:
        """Return between which differences (slots a stretch, loop less rival) chance alone may have it: 95 %.

        Bootstrap over the stretches, drawn in pairs: one stall of the machine is many slots, all in one.
        """
        apart = np.subtract(self.stretches["loop"], self.stretches[rival])
        rows = np.random.default_rng(0).integers(0, apart.size, (draws, apart.size))
        low, high = np.percentile(apart[rows].mean(axis=1), [2.5, 97.5])
        return float(low), float(high)

    def against(self, rival: str) -> dict[str, float | None]:
        """Return the loop's percentiles and longest lateness over the rival's; None where that has 0 us."""
        ours, theirs = self.runners["loop"].spread.figures(), self.runners[rival].spread.figures()
        return {name.removesuffix("_us"): ratio(ours[name], theirs[name]) for name in ours}

    def to_json(self) -> dict[str, Any]:
        """Return all figures."""
        return {
            "rate_hz": self.rate_hz,
            "runners": {name: measured.to_json() for name, measured in self.runners.items()},
            "ratios": {rival: self.against(rival) for rival in self.runners if rival != "loop"},
            "execution": self.execution.figures(),
            "realtime": dict(self.realtime),
        }


def measure(
    config: Configuration,
    rate_hz: float,
    seconds: float,
    *,
    priority: int,
    stretch: float = STRETCH_S,
    progress: Callable[[float, str], None] | None = None,
) -> AtRate:
    """Run the loop of `config`, cyclictest (where installed) and plain Python at `rate_hz`, `seconds` each.

    cyclictest runs on the core that the loop was pinned to. `progress(done 0 to 1, who runs)` is called
    before each stretch. Raises what a run raises.
    """
    config = at_rate(config, rate_hz)
    pieces = max(1, round(seconds / stretch))
    each = seconds / pieces
    program = cyclictest.available()
    names = [name for name in RUNNERS if name != "cyclictest" or program is not None]
    spreads: dict[str, list[Spread]] = {name: [] for name in names}
    executions: list[Spread] = []
    realtime: dict[str, str] = {}
    _warm(config)
    for number in range(pieces):
        # Each begins a round in its turn: what a stretch leaves behind is not always the same one's burden.
        for turn in range(len(names)):
            name = names[(number + turn) % len(names)]
            if progress is not None:
                progress((number + turn / len(names)) / pieces, name)
            if name == "loop":
                run = stretch_of(config, each, priority)
                spreads[name].append(Spread.of(wake_ups(run.columns["lateness_us"], run.columns["overrun"])))
                executions.append(Spread.of(run.columns["execution_us"][1:]))
                realtime = dict(run.realtime)
            elif name == "cyclictest":
                assert program is not None
                cores = realtime.get("cores", "")
                core = int(cores) if cores.isdigit() else None
                spreads[name].append(cyclictest.measure(program, rate_hz, each, priority, core))
            else:
                spreads[name].append(Spread.of(plain.measure(rate_hz, each)))
    period_us = 1e6 / rate_hz
    runners = {name: Measured(Spread.joined(parts), period_us) for name, parts in spreads.items()}
    missed = {name: tuple(part.missed(period_us) for part in parts) for name, parts in spreads.items()}
    return AtRate(rate_hz, runners, Spread.joined(executions), realtime, missed)


def at_rate(config: Configuration, rate_hz: float) -> Configuration:
    """Return the configuration at another rate, on a wall clock."""
    return config.changed(rate=rate_hz, clock="wall")


def stretch_of(config: Configuration, seconds: float, priority: int) -> Run:
    """Identify and compensate for `seconds` on a wall clock with everything that a run has, and record it."""
    device = make_device(config)
    tick = make_tick(config, device.delay_ticks)
    plan = ReferencePlan(
        config.reference(), config.stage, config.period, max(2, round(seconds * config.stage.rate)),
        device.delay_ticks, ALWAYS, 0.0,
    )  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="rtcomp-bench-") as folder:
        return run_loop(config, plan, device, tick, path=Path(folder, "run.h5"), priority=priority)


def wake_ups(lateness_us: Floats, overrun: npt.ArrayLike) -> Floats:
    """Return the lateness (us) of each wake-up from a recording's columns of ticks and lost slots.

    Rows of slots lost are no wake-ups: they say how late the one was that came after them, whose own row
    counts from the last slot before it.
    """
    lost = np.asarray(overrun) == LOST
    after = np.append(False, lost[:-1]) & ~lost
    woken = np.where(after, np.append(0.0, lateness_us[:-1]), lateness_us)
    return np.asarray(woken[~lost])


def _warm(config: Configuration) -> None:
    """Have everything compiled: the first run of a program may load kernels in its first tick."""
    device = make_device(config.changed(clock="virtual", device={"driver": "simulated"}))
    device.open()
    device.exchange(0.0)
    device.exchange(0.0)
    device.close()
