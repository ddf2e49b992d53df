"""`rtcomp plant`: stand in for hardware."""

from __future__ import annotations

from pathlib import Path

import click
from rtcomp_drivers.plant_links import LINKS

from rtcomp.cli.options import Within


@click.group()
def plant() -> None:
    """Stand in for hardware: a simulated stage in its own process, in real time, behind a port.

    \b
    Examples:
      rtcomp plant serve --config configs/leuven.yaml --serial
      rtcomp plant serve --config configs/leuven.yaml --link odrive-can
    """


@plant.command()
@click.option("--config", required=True, type=click.Path(path_type=Path), help="Stage file or configuration.")
@click.option(
    "--link",
    type=click.Choice(list(LINKS)),
    default="serial",
    show_default=True,
    help="What it speaks; CAN links come as an slcan adapter's port.",
)
@click.option("--serial", "link", flag_value="serial", help="The same as --link serial.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the simulated noise.")
@click.option("--json", "as_json", is_flag=True, help="Print the port as JSON.")
@click.option("--log", type=click.Path(path_type=Path), help="File for the summary at exit, else stderr.")
@click.option(
    "--firmware", type=click.Path(path_type=Path), help="The board's program, made by `make firmware`."
)
@click.option(
    "--watchdog",
    type=Within(0.001, 10.0),
    metavar="S",
    help="Of a drive that has its own (CAN); on serial the host sets it.",
)
def serve(
    config: Path,
    link: str,
    seed: int,
    as_json: bool,
    log: Path | None,
    firmware: Path | None,
    watchdog: float | None,
) -> None:
    """Serve the stage in CONFIG behind a pty and print the port to use; ends with Ctrl-C.

    It has the watchdog that a board or drive has: without commands for the time set, its output goes to zero
    and it has to be armed anew.

    \b
    Examples:
      rtcomp plant serve --config configs/leuven.yaml --serial
      rtcomp plant serve --config configs/leuven.yaml --link odrive-can
    """
    from rtcomp_drivers.plant_server import serve as run

    from rtcomp.stage.stage import Stage

    run(
        Stage.load(config), link=link, seed=seed, as_json=as_json, log=log, firmware=firmware,
        watchdog=watchdog,
    )  # fmt: skip
