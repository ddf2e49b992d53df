"""`rtcomp paper`: the paper's figures made anew, and every claim of its text tested."""

from __future__ import annotations

from pathlib import Path

import click

from rtcomp.cli.diagnose import Steps
from rtcomp.cli.options import json_option, map_option, output_options
from rtcomp.cli.output import prepare_output
from rtcomp.cli.runs import to_json


@click.command()
@click.argument("recording", required=False, type=click.Path(path_type=Path))
@output_options("out/paper")
@click.option(
    "--config", type=click.Path(path_type=Path),
    help="What the recording's axis is and calls its columns, instead of heads_yaw.yaml.",
)  # fmt: skip
@click.option("--quick", is_flag=True, help="Fewer seeds and cycles: some seconds, wider ranges.")
@map_option
@json_option
def paper(
    recording: Path | None,
    out: Path,
    force: bool,
    config: Path | None,
    quick: bool,
    mapping: dict[str, str],
    as_json: bool,
) -> None:
    """Make figures 9a to 15 of the paper anew and test each claim of its text: true or false, with a number.

    All on the simulated Leuven stage. In the place of the paper's real setup stands that stage with
    asymmetric
    and non-congruent friction or, for figures 10 to 12, a RECORDING that holds a main loop several times and
    minor loops. The folder holds paper.html and paper.json.

    \b
    Examples:
      rtcomp paper --out out/paper
      rtcomp paper yaw.csv.gz --quick --out out/paper-yaw
    """
    from rtcomp.jobs.configuration import Configuration
    from rtcomp.jobs.demo import shipped
    from rtcomp.jobs.paper.identification import QUICK, Effort
    from rtcomp.jobs.paper.measured import cut
    from rtcomp.jobs.paper.study import study
    from rtcomp.recording.reader import read
    from rtcomp.report.page import write_page
    from rtcomp.report.paper_page import claim_rows, paper_page
    from rtcomp.report.terminal import print_claims
    from rtcomp.yamlfile import write_text

    if recording is None and (config is not None or mapping):
        given = "--config" if config is not None else "--map"
        raise click.UsageError(f"{given} speaks of a recording; name the recording too")
    measured = None
    if recording is not None:
        axis = Configuration.load(config or shipped("heads_yaw.yaml"))
        section = axis.run.recording
        measured = cut(axis, read(recording, {**section.map, **mapping}, rate_hz=section.rate))
    with prepare_output(out, force) as work:
        with Steps(quiet=as_json) as steps:
            done = study(QUICK if quick else Effort(), measured, lambda part, name: steps.update(name, part))
        told = done.to_json()
        write_text(work / "paper.json", to_json(told) + "\n")
        write_page(work / "paper.html", paper_page(done))
    if as_json:
        click.echo(to_json({**told, "out": str(out)}))
        return
    print_claims(f"{told['claims_true']} claims true, {told['claims_false']} false here", claim_rows(done))
    click.echo(f"Page: {out / 'paper.html'}")
