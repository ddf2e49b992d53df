"""The circle closed: an effect hidden in the plant, diagnosed, and compensated with what was found.

python tools/bench_circle.py --json circle.json             # real time, serial link, plant in another process
python tools/bench_circle.py --virtual --json circle.json   # virtual time, one tick of delay
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
from figures_table import Figure, show
from rtcomp_drivers.plant_process import PlantProcess

from rtcomp.circle import demonstrate as d
from rtcomp.cli.runs import load
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import identify
from rtcomp.stage.stage import Stage

HIDDEN: list[dict[str, Any]] = [
    {"name": "cogging", "amplitude": 1.2, "period": 1.6e-4, "phase": 0.3},
    {"name": "asymmetric-friction", "asymmetry": 0.3},
    {"name": "drive-deadband", "width": 0.4},
    {"name": "position-dependent-friction", "amplitude": 0.3, "period": 2.2e-4, "phase": 0.5},
]


@contextlib.contextmanager
def moving(config: Configuration, plant: Stage, virtual: bool, folder: Path) -> Iterator[Configuration]:
    """Give the configuration with `plant` behind it, here or in a process of its own."""
    if virtual:
        yield config.changed(device={"driver": "simulated", "delay_ticks": 1}).simulating(plant)
        return
    path = folder / "plant.yaml"
    plant.save(path)
    with PlantProcess(path) as process:
        yield config.changed(device={"driver": "serial", "port": process.port})


@click.command()
@click.option("--virtual", is_flag=True, help="Virtual time with one tick of delay instead of the link.")
@click.option("--seconds", type=float, help="Length of each run.")
@click.option(
    "--only", type=click.Choice([h["name"] for h in HIDDEN]), help="One effect instead of all four."
)
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(virtual: bool, seconds: float | None, only: str | None, path: Path | None) -> None:
    config = d.searching(load(shipped("leuven.yaml")), seconds)
    figures, details = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with moving(config, config.stage, virtual, folder) as real:
            model = identify(real).model
            ordinary = d.compensated(real, "believed", model, out=folder)
        for hidden in HIDDEN:
            if only is not None and hidden["name"] != only:
                continue
            plant = d.with_effect(config.stage, hidden)
            out = folder / hidden["name"]
            out.mkdir()
            with moving(config, plant, virtual, folder) as concealing:
                circle = d.close_circle(ordinary, concealing, hidden, model, out=out)
            believed, before, after = circle.errors
            what = hidden["name"]
            named = ", ".join(" or ".join(e.names) for e in circle.found.effects) or "nothing"
            figures += [
                Figure(
                    f"{what}: tracking error smaller by",
                    circle.improvement,
                    "times",
                    ">= 5",
                    f"named: {named}",
                ),
                Figure(f"{what}: rms before it was hidden", 1e6 * believed.rms, "um"),
                Figure(f"{what}: rms with it hidden", 1e6 * before.rms, "um"),
                Figure(f"{what}: rms after the diagnosis", 1e6 * after.rms, "um"),
            ]
            details.append(circle.summary())
    how = "virtual time, one tick of delay" if virtual else "serial link, wall clock"
    show(f"Hidden, diagnosed, compensated: simulated Leuven stage, {how}", figures, path, circles=details)


if __name__ == "__main__":
    main()
