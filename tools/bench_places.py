"""Intervals that place themselves against equal ones, over drawn virgin curves, and what that costs a tick.

Each curve is the slope of a branch over the range: exponential, a few or two hundred stops of drawn
reaches, a power of the travel left, a hyperbola. The truth is an interval operator of 400 equal intervals;
learning sees modulated cycles through saturation, the frozen weights are judged on others without noise.

    python tools/bench_places.py --json places.json
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from figures_table import Figure, show

from rtcomp.bench.tick import measure
from rtcomp.cli.runs import load
from rtcomp.hysteresis import Basis, regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.learner import learn, learn_places
from rtcomp.hysteresis.moving.self_placing import SelfPlacingBasis
from rtcomp.hysteresis.rls import Rls
from rtcomp.jobs.demo import shipped
from rtcomp.kernels import Floats

FINE, RANGE = 400, 1.0
CYCLES, SAMPLES, GATE = 60, 500, 0.002
LEARNER = Rls(0.99997)


def virgin_curve(draw: np.random.Generator) -> Floats:
    """Return the slopes of a drawn branch on `FINE` equal intervals; saturated, it pushes with 1."""
    way = (np.arange(FINE) + 0.5) / FINE
    kind = draw.integers(5)
    if kind == 0:
        slope = np.exp(-way / 10 ** draw.uniform(-1.5, -0.3))
    elif kind == 1:
        count = draw.integers(3, 12)
        reaches, shares = draw.uniform(0.02, 1.0, count), draw.dirichlet(np.ones(count))
        slope = ((way[:, None] < reaches) * shares / reaches).sum(axis=1)
    elif kind == 2:
        slope = (1.0 - way) ** 10 ** draw.uniform(-0.3, 1.0)
    elif kind == 3:
        slope = 1.0 / (way + 10 ** draw.uniform(-1.5, 0.0)) ** 2
    else:
        middle, spread = draw.uniform(-1.2, -0.3), draw.uniform(0.1, 0.5)
        reaches = np.minimum(1.0, 10 ** draw.normal(middle, spread, 200))
        slope = ((way[:, None] < reaches) / reaches).sum(axis=1)
    return np.asarray(2.0 * FINE * slope / slope.sum())


def motion(draw: np.random.Generator, samples: int, cycles: int) -> Floats:
    """Return a sine whose amplitude goes up and down between 0.08 and 0.55 of the range."""
    time = np.arange(samples) / samples
    amplitude = 0.55 * (0.15 + 0.85 * np.abs(np.sin(np.pi * cycles / 7.3 * time + draw.uniform(0.0, 3.0))))
    return np.asarray(amplitude * np.sin(2 * np.pi * cycles * time))


def off(basis: Basis, weights: Floats, inputs: Floats, wanted: Floats) -> float:
    """Return the rms error of frozen weights over the peak."""
    return float(np.sqrt(np.mean((regressors(basis, inputs) @ weights - wanted) ** 2)) / np.abs(wanted).max())


def compare(seed: int, curves: int, noise: float) -> Floats:
    """Return the held-out errors, (curves, 4).

    Of 20 equal, 20 and 8 self-placed intervals, and of the equal ones learned under other noise.
    """
    fine, equal, found = IntervalBasis.over(FINE, RANGE), IntervalBasis.over(20, RANGE), []
    for number in range(curves):
        draw = np.random.default_rng([seed, number])
        slopes = virgin_curve(draw)
        own, other = motion(draw, CYCLES * SAMPLES, CYCLES), motion(draw, 6000, 12)
        clean, wanted = regressors(fine, own) @ slopes, regressors(fine, other) @ slopes
        level = noise * np.abs(clean).max()
        force, again = (clean + level * draw.standard_normal(clean.size) for _ in range(2))
        row = [off(equal, learn(equal, LEARNER, own, force, GATE), other, wanted)]
        for count in (20, 8):
            placed, weights = learn_places(SelfPlacingBasis.over(count, RANGE), LEARNER, own, force, GATE)
            row.append(off(placed, weights, other, wanted))
        row.append(off(equal, learn(equal, LEARNER, own, again, GATE), other, wanted))
        found.append(row)
    return np.array(found)


def figures_of(errors: Floats, noise: float) -> list[Figure]:
    """Return the figures; without noise 5 % is a limit, with noise chance alone goes beyond it: shown."""
    head = f"noise {100 * noise:g} % of peak: "
    equal, placed, few, again = errors.T
    ratio, fewer, chance = placed / equal, few / equal, again / equal
    says = (
        f"median held-out error: {100 * np.median(equal):.3g} % equal, {100 * np.median(placed):.3g} % placed"
    )
    worse, quiet = ratio > 1.05, noise == 0.0
    where = f"equal ones are off by {100 * equal[worse].max():.2g} % or less there" if worse.any() else ""
    luck = f"{np.count_nonzero(chance > 1.05)} equal ones under other noise, worst {chance.max():.3g}"
    return [
        Figure(head + "20 placed over 20 equal, median", float(np.median(ratio)), "", "<= 0.333333", says),
        Figure(head + "worse than equal by over 5 %", float(worse.sum()), f"of {worse.size}",
               "<= 0" if quiet else "", where),
        Figure(head + "worst over equal", float(ratio.max()), "", "<= 1.05" if quiet else "",
               "" if quiet else luck),
        Figure(head + "8 placed over 20 equal, median", float(np.median(fewer)), "", "<= 1",
               f"median held-out error: {100 * np.median(few):.3g} %"),
    ]  # fmt: skip


def costs() -> list[Figure]:
    """Return what the tick's kernel takes with equal and with self-placed intervals."""
    found = []
    for model, count, learner, most in (
        ("interval", 20, "rls", ""),
        ("self-placing", 20, "rls", "<= 3"),
        ("self-placing", 200, "nlms", "<= 10"),
    ):  # fmt: skip
        config = load(shipped("leuven.yaml"))
        section = {**config.file.data["identify"], "model": model, "intervals": count,
                   "learner": {"learner": learner}}  # fmt: skip
        kernel = measure(config.changed(identify=section)).kernel
        name = f"kernel of a tick, {count} intervals, {model}, {learner}"
        note = f"p99 {kernel.percentile(99):.3g} us"
        found.append(Figure(name, kernel.percentile(50), "us", most, note))
    return found


@click.command()
@click.option("--curves", default=200, show_default=True)
@click.option("--seed", default=1, show_default=True)
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(curves: int, seed: int, path: Path | None) -> None:
    figures = []
    for noise in (0.0, 0.005):
        figures += figures_of(compare(seed, curves, noise), noise)
    show(f"Self-placed intervals, {curves} virgin curves", [*figures, *costs()], path)


if __name__ == "__main__":
    main()
