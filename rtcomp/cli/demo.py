"""`rtcomp demo`: identify and compensate a simulated stage, to the report."""

from __future__ import annotations

import contextlib
from pathlib import Path

import click

from rtcomp.cli.options import Within, json_option, output_options
from rtcomp.cli.output import prepare_output
from rtcomp.cli.runs import finish, lasting, load


@click.command()
@output_options("out/demo")
@click.option("--config", type=click.Path(path_type=Path), help="Another configuration than leuven.yaml.")
@click.option("--serial", is_flag=True, help="In real time over a serial link, stage in another process.")
@click.option("--seconds", type=Within(8.0, 1e6), help="Length of each run, instead of the file's.")
@json_option
def demo(
    out: Path, force: bool, config: Path | None, serial: bool, seconds: float | None, as_json: bool
) -> None:
    """Identify a friction hysteresis while the stage moves, and see the tracking error fall.

    A first run learns from its start and feeds forward from its sixth second on. Then the weights are
    judged on other motion, and one reference is followed without and with compensation.

    \b
    Examples:
      rtcomp demo --out out/demo
      rtcomp demo --serial --out out/demo-serial
    """
    from rtcomp_drivers.plant_process import PlantProcess

    from rtcomp.jobs.demo import demo as run
    from rtcomp.jobs.demo import shipped
    from rtcomp.report.pages import demo_page, demo_rows
    from rtcomp.report.watch import TerminalWatch

    path = config or shipped("leuven.yaml")
    chosen = load(path)
    with prepare_output(out, force) as work, contextlib.ExitStack() as stack:
        if serial:
            plant = stack.enter_context(PlantProcess(path))
            chosen = lasting(load(path, port=plant.port), seconds or 20.0)
        elif seconds is not None:
            chosen = lasting(chosen, seconds)
        titles = ["live", "learn", "judge", "without", "with"]
        watch = TerminalWatch(titles, quiet=as_json)
        stack.callback(watch.close)
        done = run(chosen, out=work, watch=watch)
        done.identified.model.save(work / "model.yaml")
        finish(
            out, work, chosen, "identified and compensated", demo_rows(done), done.summary(), demo_page(done),
            as_json,
        )  # fmt: skip
