"""`rtcomp inspect`: is a recorded hysteresis symmetric, congruent, closed, the same at every speed?"""

from __future__ import annotations

import contextlib
from pathlib import Path

import click

from rtcomp.cli.options import Within, force_option, json_option, map_option, prepare_output, rate_option
from rtcomp.cli.runs import to_json

COLUMNS = ("time", "position", "voltage", "enabled", "status", "overrun", "gap", "outlier")
"""What an inspection looks at of a recording."""


@click.command()
@click.argument("recording", type=click.Path(path_type=Path))
@click.option(
    "--stage", "stage_file", type=click.Path(path_type=Path),
    help="Stage file or configuration: what of the force is no hysteresis. Without it voltage is force.",
)  # fmt: skip
@click.option(
    "--out", metavar="DIR", type=click.Path(path_type=Path), help="Folder for inspect.html and inspect.json."
)
@force_option
@map_option
@rate_option
@click.option(
    "--smoothing", type=Within(0), metavar="HZ",
    help="Low-pass of position and force alike, 0 for none; by default what sensor and motion ask for.",
)  # fmt: skip
@click.option(
    "--reversal", type=Within(0, min_open=True), metavar="M",
    help="Smallest motion back that is a reversal; by default 2 % of the stroke, or what the sensor sees.",
)  # fmt: skip
@click.option(
    "--settle", type=Within(0), metavar="S",
    help="Leave out branches that begin before; by default the first loop, where there are enough.",
)  # fmt: skip
@json_option
def inspect(
    recording: Path,
    stage_file: Path | None,
    out: Path | None,
    force: bool,
    mapping: dict[str, str],
    rate: float | None,
    smoothing: float | None,
    reversal: float | None,
    settle: float | None,
    as_json: bool,
) -> None:
    """Test the hysteresis in RECORDING: symmetry, congruency, closed minor loops, dependence on the rate.

    The paper's Fig. 11, as figures and as numbers beside the scatter of repeats. Any recording will do that
    goes to and fro; every test says what it lacks. The exit status is 0 whatever the answers.

    \b
    Examples:
      rtcomp inspect run.h5 --stage configs/leuven.yaml --out out/inspection
      rtcomp inspect log.mat --map time=time --map position=qm --map voltage=vir
    """
    from rtcomp.jobs.configuration import Configuration, RecordingSection
    from rtcomp.jobs.inspect import inspect as run
    from rtcomp.recording.reader import read
    from rtcomp.report.inspection_page import Units, answers, inspected_page, inspected_rows
    from rtcomp.units import for_axis

    stage, section = None, RecordingSection.model_validate({})
    if stage_file is not None:
        chosen = Configuration.load(stage_file)
        stage, section = chosen.stage, chosen.run.recording
    names = {**section.map, **mapping}
    data = read(recording, names, rate_hz=rate or section.rate, only=COLUMNS)
    done = run(
        data, stage, delay_ticks=section.delay_ticks, smoothing_hz=smoothing, reversal=reversal, settle=settle
    )
    if stage is not None:
        units = Units(for_axis("m", stage.mechanics.axis), for_axis("N", stage.mechanics.axis))
    else:  # a column of another name is in a unit of its own
        units = Units("" if "position" in names else "m", "" if "voltage" in names else "V")
    summary = {
        **done.summary(),
        "stage": None if stage_file is None else stage_file.name,
        "position_unit": units.position,
        "force_unit": units.force,
    }
    with contextlib.ExitStack() as stack:
        if out is not None:
            from rtcomp.report.page import write_page
            from rtcomp.yamlfile import write_text

            page = inspected_page(done, units, stage_file.name if stage_file is not None else "")
            work = stack.enter_context(prepare_output(out, force))
            write_text(work / "inspect.json", to_json(summary) + "\n")
            write_page(work / "inspect.html", page)
    if as_json:
        click.echo(to_json({**summary, **({"out": str(out)} if out is not None else {})}))
        return
    from rtcomp.report.terminal import print_summary

    print_summary("inspected", inspected_rows(done, units))
    for answer in answers(done):
        click.echo(answer)
    for note in done.notes:
        click.echo(f"Note: {note}")
    if out is not None:
        click.echo(f"Report: {out / 'inspect.html'}")
