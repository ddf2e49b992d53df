"""Lateness at 1, 2, 5 and 10 kHz with the other cores busy, beside cyclictest and plain Python, by turns.

The loop identifies, compensates and records, on the simulated device; at 1 kHz also over the serial link.

    python tools/bench_lateness.py --seconds 60 --json lateness.json
"""

from __future__ import annotations

from pathlib import Path

import click
from figures_table import Figure, show
from rtcomp_drivers.plant_process import PlantProcess

from rtcomp.bench.busy import busy_cores, other_cores
from rtcomp.bench.loop import AtRate, Measured, measure
from rtcomp.cli.runs import load
from rtcomp.jobs.demo import shipped
from rtcomp.loop.realtime import PRIORITY

NOT_INSTALLED = "cyclictest is not installed: apt install rt-tests"


def share(measured: Measured) -> float:
    """Slots missed, in percent of all."""
    return 100.0 * measured.missed / (measured.missed + measured.spread.total)


def figures_of(at: AtRate, link: str) -> list[Figure]:
    head = f"{at.rate_hz / 1000:g} kHz{link}"
    ours, plain = at.runners["loop"], at.runners["plain Python"]
    theirs = at.runners.get("cyclictest")
    found = []
    for name, percent, most in (("p50", 50.0, ""), ("p99", 99.0, "<= 1"), ("p99.9", 99.9, "<= 1.2")):
        us = ours.spread.percentile(percent)
        note = f"plain Python {plain.spread.percentile(percent):.3g} us"
        if theirs is None:
            found.append(Figure(f"{head}: {name}", us, "us", "", f"{note}; {NOT_INSTALLED}"))
            continue
        # cyclictest counts whole microseconds, rounded down: at least one stands for its nothing.
        rival = max(1.0, theirs.spread.percentile(percent))
        note = f"{us:.3g} us; cyclictest {rival:.3g} us; {note}"
        found.append(Figure(f"{head}: {name} over cyclictest's", us / rival, "", most, note))
    most = "" if theirs is None else f"<= {share(theirs):.6f}"
    note = f"plain Python {share(plain):.2g} %"
    if theirs is not None and at.stretches:
        low, high = (
            100.0 * d * len(at.stretches["loop"]) / ours.spread.total for d in at.by_chance("cyclictest")
        )
        note = f"more than cyclictest by {low:+.2g} to {high:+.2g} %, by chance of its stalls; {note}"
    found.append(Figure(f"{head}: slots missed", share(ours), "%", most, note))
    found.append(Figure(f"{head}: longest", ours.spread.longest, "us", "", "the machine's stalls are in it"))
    return found


@click.command()
@click.option("--seconds", default=60.0, show_default=True, help="Of each runner at each rate.")
@click.option("--rate", "rates", type=float, multiple=True, default=(1000.0, 2000.0, 5000.0, 10_000.0))
@click.option("--serial/--no-serial", default=True, help="At 1 kHz over the serial link as well.")
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(seconds: float, rates: tuple[float, ...], serial: bool, path: Path | None) -> None:
    file = shipped("leuven.yaml")
    measured, figures = [], []
    with busy_cores(other_cores()) as busy:
        for rate in rates:
            measured.append(measure(load(file), rate, seconds, priority=PRIORITY))
            figures += figures_of(measured[-1], "")
        if serial:
            with PlantProcess(file) as plant:
                measured.append(measure(load(file, port=plant.port), 1000.0, seconds, priority=PRIORITY))
            figures += figures_of(measured[-1], ", serial link")
    title = f"Lateness, {seconds:g} s each by turns, {busy} busy"
    show(title, figures, path, rates=[at.to_json() for at in measured])


if __name__ == "__main__":
    main()
