"""What the commands that run the loop share: reading the configuration, writing the results."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from rtcomp.jobs.configuration import Configuration
    from rtcomp.report.page import Page, Row

F = TypeVar("F", bound=Callable[..., Any])


def device_options(function: F) -> F:
    """Add ``--port`` (argument `port`), ``--clock`` (`clock`), and what it takes to move hardware.

    That is ``--armed`` (`armed`), ``--allow-non-rt`` (`allow_non_rt`) and ``--stop-file`` (`stop_file`).
    """
    port = click.option(
        "--port",
        metavar="PORT",
        help="Port of a board, CAN interface or plant server, instead of the file's device's.",
    )
    clock = click.option(
        "--clock", type=click.Choice(["virtual", "wall"]), help="Run as fast as possible, or in real time."
    )
    armed = click.option("--armed", is_flag=True, help="Real hardware may move; without it nothing is armed.")
    anyway = click.option(
        "--allow-non-rt", is_flag=True, help="Move hardware without SCHED_FIFO and locked memory too."
    )
    stop_file = click.option(
        "--stop-file", metavar="PATH", type=click.Path(path_type=Path),
        help="Emergency stop: when this file appears, zero volts at once.",
    )  # fmt: skip
    return port(clock(armed(anyway(stop_file(function)))))


def load(
    path: Path,
    *,
    port: str | None = None,
    clock: str | None = None,
    seconds: float | None = None,
    armed: bool = False,
    allow_non_rt: bool = False,
    stop_file: Path | None = None,
) -> Configuration:
    """Read a run configuration and apply what the command line changes."""
    from rtcomp.cli.countdown import Countdown
    from rtcomp.jobs.arming import Arming
    from rtcomp.jobs.configuration import Configuration

    config = replace(Configuration.load(path), arming=Arming(armed, allow_non_rt, Countdown()))
    if stop_file is not None:
        limits = {**(config.file.data.get("limits") or {}), "stop_file": str(stop_file.absolute())}
        config = config.changed(limits=limits)
    if port is not None:
        config = config.changed(device=_at(port, config.run.device))
    if clock is not None:
        config = config.changed(clock=clock)
    if seconds is not None:
        config = lasting(config, seconds)
    return config


def _at(port: str, device: Mapping[str, Any]) -> dict[str, Any]:
    """Return the section `device` with another port; where it has no driver with one, that of a board.

    A driver on a CAN bus gets it as its channel; a path is an slcan adapter's.
    """
    from rtcomp_drivers.registry import find, names

    driver = device.get("driver")
    keys = find(driver).Settings.model_fields if driver in names() else {}
    if "channel" in keys:
        return {**device, "channel": port, **({"interface": "slcan"} if "/" in port else {})}
    return {**device, "port": port} if "port" in keys else {"driver": "serial", "port": port}


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


def to_json(summary: Mapping[str, Any]) -> str:
    """Write a summary as one JSON document; a figure that is not a finite number becomes null."""
    return json.dumps(_finite(dict(summary)), indent=2, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


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

    write_text(work / "summary.json", to_json(summary) + "\n")
    dump_yaml(work / "configuration.yaml", config.file.data)
    write_page(work / "report.html", page)
    if as_json:
        click.echo(to_json({**summary, "out": str(out)}))
        return
    from rtcomp.report.terminal import print_summary

    print_summary(title, rows)
    click.echo(f"Report: {out / 'report.html'}")
