"""What the commands that run the loop share: reading the configuration, writing the results."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from rtcomp.jobs.configuration import Configuration
    from rtcomp.report.page import Page, Row

F = TypeVar("F", bound=Callable[..., Any])


def device_options(function: F) -> F:
    """Add ``--port`` (argument `port`) and ``--clock`` (argument `clock`)."""
    port = click.option(
        "--port", metavar="PORT", help="Serial port of a board or plant server, instead of the file's device."
    )
    clock = click.option(
        "--clock", type=click.Choice(["virtual", "wall"]), help="Run as fast as possible, or in real time."
    )
    return port(clock(function))


def load(
    path: Path, *, port: str | None = None, clock: str | None = None, seconds: float | None = None
) -> Configuration:
    """Read a run configuration and apply what the command line changes."""
    from rtcomp.jobs.configuration import Configuration

    config = Configuration.load(path)
    if port is not None:
        device = {**config.file.data.get("device", {}), "driver": "serial", "port": port}
        config = config.changed(device={k: v for k, v in device.items() if k != "delay_ticks"})
    if clock is not None:
        config = config.changed(clock=clock)
    if seconds is not None:
        config = lasting(config, seconds)
    return config


def lasting(config: Configuration, seconds: float) -> Configuration:
    """Return the configuration with every reference that repeats lasting so long."""
    changes: dict[str, Any] = {}
    data = config.file.data
    if "reference" in data:
        changes["reference"] = {**data["reference"], "duration": seconds}
    for section in ("judge", "compensate"):
        if "reference" in data.get(section, {}):
            changes[section] = {
                **data[section],
                "reference": {**data[section]["reference"], "duration": seconds},
            }
    return config.changed(**changes)


def finish(
    out: Path,
    work: Path,
    config: Configuration,
    title: str,
    rows: list[Row],
    summary: dict[str, Any],
    page: Page,
    as_json: bool,
) -> None:
    """Write summary, configuration as run and report into `work`; print the table, or the JSON."""
    from rtcomp.report.page import write_page
    from rtcomp.yamlfile import dump_yaml, write_text

    write_text(work / "summary.json", json.dumps(summary, indent=2) + "\n")
    dump_yaml(work / "configuration.yaml", config.file.data)
    write_page(work / "report.html", page)
    if as_json:
        click.echo(json.dumps({**summary, "out": str(out)}, indent=2))
        return
    from rtcomp.report.terminal import print_summary

    print_summary(title, rows)
    click.echo(f"Report: {out / 'report.html'}")
