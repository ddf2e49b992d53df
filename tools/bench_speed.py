"""Speed: the operator against plain numpy, the whole tick, virtual time, many intervals, the first screen.

Medians of repeated runs on whatever machine this is; ratios are against a rival in the same run.

    python tools/bench_speed.py --json speed.json
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import click
import numpy as np
from figures_table import Figure, show

from rtcomp.bench.tick import measure, median_seconds, motion, operator
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import ALWAYS
from rtcomp.jobs.plan import ReferencePlan
from rtcomp.jobs.session import make_device, make_tick, run_loop


def virtual_seconds(config: Configuration, seconds: float) -> float:
    """Return the wall seconds of `seconds` at 10 kHz, identifying and compensating, recorded."""
    config = config.changed(rate=10_000.0)
    device, tick = make_device(config), make_tick(config, 0)
    plan = ReferencePlan(
        config.reference(), config.stage, config.period, round(seconds * 1e4), 0, ALWAYS, 0.0
    )
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        run_loop(config, plan, device, tick, path=Path(folder, "run.h5"))
        return time.perf_counter() - began


@click.command()
@click.option("--demo/--no-demo", default=True, help="Time `rtcomp demo` as well.")
@click.option("--seconds", default=60.0, show_default=True, help="Of the run in virtual time.")
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(demo: bool, seconds: float, path: Path | None) -> None:
    config = Configuration.load(shipped("leuven.yaml"))
    ticks = measure(config)
    kernel, both = ticks.kernel.percentile(50), ticks.with_device.percentile(50)
    inputs, fine = motion(1_000_000, 1000), motion(1_000_000, 100_000)
    few, many = operator(20, fine)[0], operator(1000, fine)[0]
    coarse_few, coarse_many = operator(20, inputs)[0], operator(1000, inputs)[0]
    virtual_seconds(config, 1.0)
    virtual = float(np.median([virtual_seconds(config, seconds) for _ in range(3)]))
    program = str(Path(sys.executable).parent / "rtcomp")
    screen = median_seconds(lambda: subprocess.run([program, "--help"], check=True, capture_output=True), 5)
    figures = [
        Figure("operator, 20 intervals, batch", 1e3 / coarse_few, "M samples/s", ">= 20"),
        Figure("faster than numpy, sample by sample", ticks.numpy_us / ticks.operator_us, "times", ">= 100"),
        Figure("tick: operator, RLS, feedforward, PID, limits, ring", kernel, "us", "<= 10"),
        Figure("tick with the simulated device", both, "us", "<= 10"),
        Figure(f"{seconds:g} s at 10 kHz in virtual time, recorded", virtual, "s", f"<= {seconds / 10:g}"),
        Figure("1000 intervals over 20, fine motion", many / few, "times", "<= 2", "100,000 samples a cycle"),
        Figure(
            "1000 intervals over 20, the paper's motion", coarse_many / coarse_few, "times", "",
            "1000 samples a cycle: a step crosses two of the 1000",
        ),
        Figure("rtcomp --help", screen, "s", "<= 0.5"),
    ]  # fmt: skip
    if demo:
        with tempfile.TemporaryDirectory() as folder:
            command = [program, "demo", "--out", str(Path(folder, "demo"))]
            began = time.perf_counter()
            subprocess.run(command, check=True, capture_output=True)
            figures.append(Figure("rtcomp demo", time.perf_counter() - began, "s", "<= 120"))
    show("Speed", figures, path)


if __name__ == "__main__":
    main()
