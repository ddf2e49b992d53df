"""`rtcomp demo`: identify and compensate a simulated stage, hide an effect in it, find it, to the report."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rtcomp.cli.diagnose import Steps
from rtcomp.cli.options import Within, json_option, output_options
from rtcomp.cli.output import prepare_output
from rtcomp.cli.runs import finish, lasting, load, to_json

if TYPE_CHECKING:
    from rtcomp.jobs.configuration import Configuration
    from rtcomp.stage.stage import Stage


@click.command()
@output_options("out/demo")
@click.option("--config", type=click.Path(path_type=Path), help="Another configuration than leuven.yaml.")
@click.option("--serial", is_flag=True, help="In real time over a serial link, stage in another process.")
@click.option("--seconds", type=Within(8.0, 1e6), help="Length of each run, instead of the file's.")
@click.option("--seed", type=click.IntRange(0), help="Of what is hidden; else another each time.")
@json_option
def demo(
    out: Path,
    force: bool,
    config: Path | None,
    serial: bool,
    seconds: float | None,
    seed: int | None,
    as_json: bool,
) -> None:
    """Identify a friction hysteresis, see the tracking error fall, and find an effect hidden in the stage.

    A first run learns from its start and feeds forward from its sixth second on. Then the weights are
    judged on other motion, and one reference is followed without and with compensation. Last, an effect drawn
    at random is hidden in the simulated stage: the error rises, the recording is diagnosed, and with what was
    found fed forward the error falls again.

    \b
    Examples:
      rtcomp demo --out out/demo
      rtcomp demo --seed 4 --out out/demo
      rtcomp demo --serial --out out/demo-serial
    """
    from rtcomp_drivers.plant_process import PlantProcess

    from rtcomp.circle import demonstrate as d
    from rtcomp.jobs.demo import demo as run
    from rtcomp.jobs.demo import shipped
    from rtcomp.report.circle_page import circle_rows, with_circle
    from rtcomp.report.diagnosis_page import diagnosed_page
    from rtcomp.report.page import write_page
    from rtcomp.report.pages import demo_page, demo_rows
    from rtcomp.report.watch import TerminalWatch
    from rtcomp.units import for_axis
    from rtcomp.yamlfile import write_text

    path = config or shipped("leuven.yaml")
    chosen = load(path)
    seed = time.time_ns() % 100_000 if seed is None else seed
    with prepare_output(out, force) as work, contextlib.ExitStack() as stack:
        if serial:
            plant = stack.enter_context(PlantProcess(path))
            seconds = seconds or 20.0
            chosen = lasting(load(path, port=plant.port), seconds)
            # Nothing can be hurt: on a busy machine the plant may be silent for longer than a board may.
            chosen = chosen.changed(device={**chosen.run.device, "watchdog": 1.0})
        elif seconds is not None:
            chosen = lasting(chosen, seconds)
        titles = ["live", "learn", "judge", "without", "with", "believed", "hidden", "found"]
        watch = TerminalWatch(titles, quiet=as_json)
        stack.callback(watch.close)
        done = run(chosen, out=work, watch=watch)
        model = done.identified.model
        model.save(work / "model.yaml")

        rich = d.searching(chosen, seconds)
        hidden = d.draw(seed, d.scale_of(rich, model), clock=not serial)
        ordinary = d.compensated(rich, "believed", model, out=work, watch=watch)
        concealing = stack.enter_context(_concealing(rich, d.with_effect(rich.stage, hidden), serial))
        with Steps(quiet=as_json) as steps:
            circle = d.close_circle(
                ordinary, concealing, hidden, model, out=work, watch=watch,
                progress=lambda part, name: steps.update(name, part),
            )  # fmt: skip
        d.believed(rich.stage, model).save(work / "believed.yaml")
        circle.found.stage.save(work / "stage.yaml")
        write_text(work / "diagnosis.json", to_json(circle.found.to_json()) + "\n")
        page = diagnosed_page(circle.found, ["hidden.h5"], "believed.yaml", str(out))
        write_page(work / "diagnosis.html", page)

        unit = for_axis("m", chosen.stage.axis)
        summary = {**done.summary(), "diagnose": {"seed": seed, **circle.summary()}}
        finish(
            out, work, chosen, f"identified, compensated, diagnosed (--seed {seed})",
            [*demo_rows(done), *circle_rows(circle, unit)], summary,
            with_circle(demo_page(done), circle, unit), as_json,
        )  # fmt: skip


@contextlib.contextmanager
def _concealing(config: Configuration, plant: Stage, serial: bool) -> Iterator[Configuration]:
    """Give the configuration with another plant behind its back, over the link in a process of its own."""
    if not serial:
        yield config.simulating(plant)
        return
    from rtcomp_drivers.plant_process import PlantProcess

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "plant.yaml")
        plant.save(path)
        with PlantProcess(path) as process:
            yield config.changed(device={**config.run.device, "port": process.port})
