"""`rtcomp replay`: a recording beside what a stage makes of it."""

from __future__ import annotations

from pathlib import Path

import click

from rtcomp.cli.options import Within, force_option, json_option, map_option, rate_option
from rtcomp.cli.runs import to_json


@click.command()
@click.argument("recording", type=click.Path(path_type=Path))
@click.option("--stage", "stage_file", required=True, type=click.Path(path_type=Path), help="Stage file.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="CSV file to write.")
@force_option
@map_option
@rate_option
@click.option("--bandwidth", type=Within(0, min_open=True), help="Hz, of the comparison.")
@json_option
def replay(
    recording: Path,
    stage_file: Path,
    out: Path,
    force: bool,
    mapping: dict[str, str],
    rate: float | None,
    bandwidth: float | None,
    as_json: bool,
) -> None:
    """Write both sides of the stage's force balance along RECORDING, a row a tick.

    Columns: time, voltage, position, force_drive (what the recorded voltage produced), force_motion (what
    the recorded motion needed); where the recording has a reference and the stage a controller, also
    position_simulated and voltage_simulated.

    \b
    Example:
      rtcomp replay run.h5 --stage configs/leuven.yaml --out replay.csv
    """
    from rtcomp.jobs.replay import replay as run
    from rtcomp.recording.reader import read
    from rtcomp.recording.writer import write_csv
    from rtcomp.stage.stage import Stage

    stage = Stage.load(stage_file)
    done = run(stage, read(recording, mapping, rate_hz=rate), bandwidth)
    write_csv(out, done.columns, force)
    if as_json:
        click.echo(to_json({**done.summary(), "out": str(out)}))
        return
    from rtcomp.report.page import Row
    from rtcomp.report.terminal import print_summary

    rows = [
        Row("Rows", f"{done.columns['time'].size:,}"),
        Row("Relative force error", 100 * done.relative_force_error, "%", f"below {done.bandwidth_hz:g} Hz"),
    ]
    if done.position_error_rms is not None:
        rows.append(Row("Position, simulated less recorded, rms", done.position_error_rms, "m"))
    print_summary("replayed", rows)
    for note in done.notes:
        click.echo(f"Note: {note}")
