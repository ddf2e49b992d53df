"""The job `simulate`: a stage followed in closed loop along a reference, or driven open loop by a voltage."""

from __future__ import annotations

from pathlib import Path

from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.plan import ReferencePlan, VoltagePlan
from rtcomp.jobs.session import Run, Watch, make_device, make_tick, run_loop
from rtcomp.kernels import Floats


def simulated_here(config: Configuration) -> Configuration:
    """Return the configuration with its device replaced by the simulation, in virtual time."""
    return config.changed(device={"driver": "simulated"}, clock="virtual")


def closed_loop(
    config: Configuration, *, substeps: float = 1.0, path: Path | None = None, watch: Watch | None = None
) -> Run:
    """Simulate the stage with its controller along the configured reference; no feedforward."""
    config = simulated_here(config)
    reference = config.reference()
    device = make_device(config, substeps=substeps)
    ticks = max(16, round(reference.duration * config.stage.rate))
    plan = ReferencePlan(reference, config.stage, config.period, ticks)
    return run_loop(config, plan, device, make_tick(config, 0), path=path, watch=watch)


def on_reference(config: Configuration, reference: Floats, start: float) -> Run:
    """Simulate the stage with its controller along sampled positions (m, (K,)), from rest at `start` (m)."""
    config = simulated_here(config)
    plan = VoltagePlan(0.0 * reference, config.period, reference=reference)
    return run_loop(config, plan, make_device(config, start=start), make_tick(config, 0))


def open_loop(
    config: Configuration,
    voltage: Floats,
    *,
    start: float = 0.0,
    substeps: float = 1.0,
    path: Path | None = None,
    watch: Watch | None = None,
) -> Run:
    """Simulate the stage driven by `voltage` (V, (K,), one a tick, held), from rest at `start` (m)."""
    config = simulated_here(config)
    plan = VoltagePlan(voltage, config.period)
    device = make_device(config, start=start, substeps=substeps)
    return run_loop(config, plan, device, make_tick(config, 0, closed_loop=False), path=path, watch=watch)
