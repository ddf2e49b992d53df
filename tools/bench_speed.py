"""Speed: the operator against plain numpy, the whole tick, virtual time, many intervals, the first screen.

Medians of repeated runs on whatever machine this is; ratios are against a rival in the same run.

    python tools/bench_speed.py --json speed.json
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
from figures_table import Figure, show

from rtcomp.hysteresis.interval import IntervalBasis, respond
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import ALWAYS
from rtcomp.jobs.plan import ReferencePlan
from rtcomp.jobs.session import make_device, make_tick, run_loop
from rtcomp.kernels import Floats
from rtcomp.loop.ring import Ring
from rtcomp.loop.tick import COLUMNS, tick_kernel

SPAN = 1e-4


def median_seconds(function: Callable[[], object], times: int = 9) -> float:
    function()
    taken = []
    for _ in range(times):
        began = time.perf_counter()
        function()
        taken.append(time.perf_counter() - began)
    return float(np.median(taken))


def motion(samples: int, per_cycle: int) -> Floats:
    """A sine that wanders over most of the range, so that loops of all sizes come."""
    phase = 2 * np.pi * np.arange(samples) / per_cycle
    return SPAN * (0.4 * np.sin(phase) + 0.1 * np.sin(0.137 * phase))


def plain_numpy(widths: Floats, weights: Floats, inputs: Floats) -> Floats:
    """The operator sample by sample with numpy's arrays, equations (1) to (6) as they stand."""
    x, out, last = widths / 2, np.empty(inputs.size), inputs[0]
    for k, u in enumerate(inputs):
        d, last = u - last, u
        if d >= 0:
            free = widths - x
            before = np.concatenate([[0.0], np.cumsum(free)[:-1]])
            x = np.minimum(x + np.maximum(d - before, 0.0), widths)
        else:
            before = np.concatenate([[0.0], np.cumsum(x)[:-1]])
            x = np.maximum(x - np.maximum(-d - before, 0.0), 0.0)
        out[k] = weights @ x
    return out


def operator(count: int, inputs: Floats) -> tuple[float, Floats]:
    """Return ns a sample and the output for `count` intervals over the range."""
    basis = IntervalBasis.over(count, SPAN)
    weights, out = np.linspace(2e5, 1e4, count), np.empty(inputs.size)
    p, start = basis.vector(), float(weights @ basis.widths / 2)

    def once() -> None:
        respond(p, basis.initial_state(), weights, start, inputs, out)

    return 1e9 * median_seconds(once) / inputs.size, out


def tick_us(config: Configuration) -> tuple[float, float]:
    """Return microseconds of the tick's kernel, and of the tick with a simulated device, median."""
    device = make_device(config)
    tick = make_tick(config, 0)
    reference = config.reference()
    plan = ReferencePlan(reference, config.stage, config.period, 20000, 0, ALWAYS, 0.0)
    table = plan.rows(0, plan.ticks)
    ring = Ring.create(plan.ticks, tick.row_width)
    row, position, sequence = tick.row, COLUMNS.index("position"), COLUMNS.index("sequence")
    alone, both = np.empty(plan.ticks), np.empty(plan.ticks)
    device.open()
    volts = 0.0
    for k in range(plan.ticks):
        began = time.perf_counter_ns()
        row[position] = device.exchange(volts).position
        row[sequence] = k + 1.0
        then = time.perf_counter_ns()
        volts = tick_kernel(
            table[k],
            tick.identifier,
            tick.compensator,
            tick.settings,
            tick.state,
            row,
            ring.header,
            ring.rows,
        )
        done = time.perf_counter_ns()
        alone[k], both[k] = done - then, done - began
    device.close()
    ring.release()
    return float(np.median(alone[100:])) * 1e-3, float(np.median(both[100:])) * 1e-3


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
    inputs = motion(1_000_000, 1000)
    ns, out = operator(20, inputs)
    short = inputs[:20_000]
    basis = IntervalBasis.over(20, SPAN)
    weights = np.linspace(2e5, 1e4, 20)
    assert np.allclose(
        plain_numpy(basis.widths, weights, short), out[: short.size], atol=1e-9 * np.abs(out).max()
    )
    rival = 1e9 * median_seconds(lambda: plain_numpy(basis.widths, weights, short), 3) / short.size
    fine = motion(1_000_000, 100_000)
    few, many = operator(20, fine)[0], operator(1000, fine)[0]
    coarse_few, coarse_many = ns, operator(1000, inputs)[0]
    alone, both = tick_us(config)
    virtual_seconds(config, 1.0)
    virtual = float(np.median([virtual_seconds(config, seconds) for _ in range(3)]))
    program = str(Path(sys.executable).parent / "rtcomp")
    screen = median_seconds(lambda: subprocess.run([program, "--help"], check=True, capture_output=True), 5)
    figures = [
        Figure("operator, 20 intervals, batch", 1e3 / ns, "M samples/s", ">= 20"),
        Figure("faster than numpy, sample by sample", rival / ns, "times", ">= 100"),
        Figure("tick: operator, RLS, feedforward, PID, limits, ring", alone, "us", "<= 10"),
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
