"""How long a tick takes: its kernel alone, with the simulated device, its operator beside plain rivals."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from rtcomp.bench.spread import Spread
from rtcomp.hysteresis.interval import IntervalBasis, respond
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.identify import ALWAYS
from rtcomp.jobs.plan import ReferencePlan
from rtcomp.jobs.session import make_device, make_tick
from rtcomp.kernels import Floats
from rtcomp.loop.bound import BoundTick
from rtcomp.loop.ring import Ring
from rtcomp.loop.tick import COLUMNS

SPAN = 1e-4
"""m, range of the operator that is timed."""
INTERVALS = 20
LEFT_OUT = 100
"""First ticks that do not count: caches are cold."""


@dataclass(frozen=True)
class Ticks:
    """What a tick takes on this machine."""

    kernel: Spread
    """us, the tick's kernel: check, identify, compensate, limit, hand over to the ring."""
    with_device: Spread
    """us, with an exchange with the simulated device."""
    operator_us: float
    """us a sample, the interval operator called for many samples at once."""
    numpy_us: float
    """us a sample, the same operator sample by sample with numpy's arrays."""
    python_us: float
    """us a sample, the same operator in Python alone."""

    def to_json(self) -> dict[str, Any]:
        """Return all figures, and the ratios of the rivals."""
        return {
            "kernel": self.kernel.figures(),
            "with_device": self.with_device.figures(),
            "operator_us": self.operator_us,
            "numpy_us": self.numpy_us,
            "python_us": self.python_us,
            "ratios": {
                "numpy": self.numpy_us / self.operator_us, "python": self.python_us / self.operator_us
            },
        }  # fmt: skip


def measure(config: Configuration, ticks: int = 20_000) -> Ticks:
    """Time `ticks` ticks of `config` on the simulated stage, and the operator of its rivals' size."""
    kernel, both = tick_times(config, ticks)
    inputs = motion(max(2000, 10 * ticks), 1000)
    ours, out = operator(INTERVALS, inputs)
    short = inputs[: max(500, ticks // 10)]
    basis, weights = IntervalBasis.over(INTERVALS, SPAN), falling(INTERVALS)
    taken = []
    for rival in (plain_numpy, plain_python):
        if not np.allclose(
            rival(basis.widths, weights, short), out[: short.size], atol=1e-9 * np.abs(out).max()
        ):
            raise AssertionError(f"{rival.__name__} is no rival: it gives another output")
        taken.append(1e6 * median_seconds(partial(rival, basis.widths, weights, short), 3) / short.size)
    return Ticks(kernel, both, 1e-3 * ours, *taken)


def median_seconds(function: Callable[[], object], times: int = 9) -> float:
    """Return the median wall time (s) of a call, after one that does not count."""
    function()
    taken = []
    for _ in range(times):
        began = time.perf_counter()
        function()
        taken.append(time.perf_counter() - began)
    return float(np.median(taken))


def motion(samples: int, per_cycle: int) -> Floats:
    """Return a sine (m) that wanders over most of the range, so that loops of all sizes come."""
    phase = 2 * np.pi * np.arange(samples) / per_cycle
    return np.asarray(SPAN * (0.4 * np.sin(phase) + 0.1 * np.sin(0.137 * phase)))


def falling(count: int) -> Floats:
    """Return weights (N/m) as a virgin curve that gets less steep has them."""
    return np.linspace(2e5, 1e4, count)


def operator(count: int, inputs: Floats) -> tuple[float, Floats]:
    """Return ns a sample and the output for `count` intervals over the range."""
    basis = IntervalBasis.over(count, SPAN)
    weights, out = falling(count), np.empty(inputs.size)
    p, start = basis.vector(), float(weights @ basis.widths / 2)

    def once() -> None:
        respond(p, basis.initial_state(), weights, start, inputs, out)

    return 1e9 * median_seconds(once) / inputs.size, out


def plain_numpy(widths: Floats, weights: Floats, inputs: Floats) -> Floats:
    """Return the operator sample by sample with numpy's arrays, equations (1) to (6) as they stand."""
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


def plain_python(widths: Floats, weights: Floats, inputs: Floats) -> Floats:
    """Return the operator in Python alone, on lists."""
    a, w = widths.tolist(), weights.tolist()
    x, out, last = [0.5 * width for width in a], [], float(inputs[0])
    for u in inputs.tolist():
        left, last = u - last, u
        for i, width in enumerate(a):
            if left > 0.0:
                step = min(left, width - x[i])
            elif left < 0.0:
                step = -min(-left, x[i])
            else:
                break
            x[i] += step
            left -= step
        out.append(sum(wi * xi for wi, xi in zip(w, x, strict=True)))
    return np.array(out)


def tick_times(config: Configuration, ticks: int) -> tuple[Spread, Spread]:
    """Return the times (us) of the tick's kernel, and of the tick with a simulated device."""
    config = config.changed(device={"driver": "simulated"})
    device = make_device(config)
    tick = make_tick(config, 0)
    plan = ReferencePlan(config.reference(), config.stage, config.period, ticks + LEFT_OUT, 0, ALWAYS, 0.0)
    table = plan.rows(0, plan.ticks)
    ring = Ring.create(plan.ticks, tick.row_width)
    row, position, sequence = tick.row, COLUMNS.index("position"), COLUMNS.index("sequence")
    alone, both = np.empty(plan.ticks), np.empty(plan.ticks)
    bound = BoundTick(
        tick.identifier, tick.compensator, tick.settings, tick.state, row, ring.header, ring.rows
    )
    device.open()
    volts = 0.0
    for k in range(plan.ticks):
        began = time.perf_counter_ns()
        row[position] = device.exchange(volts).position
        row[sequence] = k + 1.0
        then = time.perf_counter_ns()
        volts = bound(table[k])
        done = time.perf_counter_ns()
        alone[k], both[k] = done - then, done - began
    device.close()
    ring.release()
    return Spread.of(1e-3 * alone[LEFT_OUT:]), Spread.of(1e-3 * both[LEFT_OUT:])
