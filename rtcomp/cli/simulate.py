"""`rtcomp simulate`: a stage in closed loop along a reference, or open loop under a voltage."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rtcomp.cli.options import Within, json_option, map_option, output_options
from rtcomp.cli.output import prepare_output
from rtcomp.cli.runs import finish, lasting, load

if TYPE_CHECKING:
    from rtcomp.jobs.configuration import Configuration


@click.command()
@click.argument("config", type=click.Path(path_type=Path))
@output_options("out/simulate")
@click.option("--reference", type=click.Path(path_type=Path), help="YAML file with another reference.")
@click.option(
    "--voltage", "recording", type=click.Path(path_type=Path),
    help="Open loop: the recording whose voltage drives the stage.",
)  # fmt: skip
@click.option("--seconds", type=Within(0.1, 1e6), help="Length of the run, instead of the file's.")
@click.option("--substeps", type=Within(1, 1000), default=1.0, help="Finer integration.")
@map_option
@json_option
def simulate(
    config: Path,
    out: Path,
    force: bool,
    reference: Path | None,
    recording: Path | None,
    seconds: float | None,
    substeps: float,
    mapping: dict[str, str],
    as_json: bool,
) -> None:
    """Simulate the stage in CONFIG and record it as a run on hardware would be.

    \b
    Examples:
      rtcomp simulate configs/leuven.yaml --out out/simulated
      rtcomp simulate stage.yaml --voltage run.h5 --out out/open-loop
    """
    import numpy as np

    from rtcomp.jobs.session import check
    from rtcomp.jobs.simulate import closed_loop, open_loop, simulated_here
    from rtcomp.recording.reader import read
    from rtcomp.report.pages import simulated_page, simulated_rows
    from rtcomp.report.watch import TerminalWatch

    chosen = load(config)
    if reference is not None:
        chosen = _with_reference(chosen, reference)
    if seconds is not None:
        chosen = lasting(chosen, seconds)
    data = None
    if recording is not None:
        data = read(recording, mapping, needed=("time", "voltage"))
        chosen = chosen.changed(rate=data.rate_hz)
    else:
        check(simulated_here(chosen), "")
    with prepare_output(out, force) as work:
        watch = TerminalWatch(["simulate"], quiet=as_json)
        path = work / "recording.h5"
        if data is not None:
            start = float(data.columns["position"][0]) if "position" in data.columns else 0.0
            run = open_loop(chosen, data.voltage, start=start, substeps=substeps, path=path, watch=watch)
        else:
            run = closed_loop(chosen, substeps=substeps, path=path, watch=watch)
        position = run.columns["position"]
        summary = {
            "ticks": run.outcome.ticks,
            "position_min_m": float(position.min()),
            "position_max_m": float(position.max()),
            "tracking_rms_m": None
            if data is not None
            else float(np.sqrt(np.mean(run.tracking_error()[1] ** 2))),
        }
        page = simulated_page(chosen, run, open_loop=data is not None)
        finish(out, work, chosen, "simulated", simulated_rows(chosen, run), summary, page, as_json)


def _with_reference(config: Configuration, path: Path) -> Configuration:
    from rtcomp.jobs.configuration import Configuration
    from rtcomp.yamlfile import YamlFile, load_yaml

    file = load_yaml(path)
    if "reference" not in file.data:  # the section's content alone
        lines = {("reference", *key): line for key, line in file.lines.items()}
        file = YamlFile({"reference": file.data}, path, lines)
    data = {**config.file.data, "reference": file.data["reference"]}
    return Configuration.of(replace(config.file, data=data, origins={"reference": file}))
