"""`rtcomp identify`: position and voltage in, hysteresis model out."""

from __future__ import annotations

from pathlib import Path

import click

from rtcomp.cli.options import Within, json_option, map_option, output_options
from rtcomp.cli.output import prepare_output
from rtcomp.cli.runs import device_options, finish, load
from rtcomp.errors import Interrupted


@click.command()
@click.argument("config", type=click.Path(path_type=Path))
@click.argument("recording", required=False, type=click.Path(path_type=Path))
@output_options("out/identify")
@device_options
@click.option("--seconds", type=Within(0.1, 1e6), help="Length of each run, instead of the file's.")
@map_option
@json_option
def identify(
    config: Path,
    recording: Path | None,
    out: Path,
    force: bool,
    port: str | None,
    clock: str | None,
    armed: bool,
    allow_non_rt: bool,
    stop_file: Path | None,
    seconds: float | None,
    mapping: dict[str, str],
    as_json: bool,
) -> None:
    """Identify the friction's hysteresis of the device in CONFIG while it moves, or of a RECORDING.

    RECORDING is a CSV, MAT or HDF5 file, or a folder that holds one.
    Weights are learned tick by tick, then frozen and judged on motion that they were not learned from. The
    folder holds model.yaml (usable as a stage's friction), recording.h5, the configuration as run,
    summary.json and report.html.

    \b
    Examples:
      rtcomp identify configs/leuven.yaml --out out/leuven
      rtcomp identify configs/heads_yaw.yaml yaw.csv.gz --out out/yaw
      rtcomp identify configs/leuven.yaml --port /dev/ttyACM0 --armed --out out/board
    """
    chosen = load(
        config, port=port, clock=clock, seconds=seconds, armed=armed, allow_non_rt=allow_non_rt,
        stop_file=stop_file,
    )  # fmt: skip
    chosen.identify  # noqa: B018 -- raises where the section is missing
    from rtcomp.jobs.identify import identify as run
    from rtcomp.jobs.session import check
    from rtcomp.recording.reader import read
    from rtcomp.report.pages import identified_page, identified_rows
    from rtcomp.report.watch import TerminalWatch
    from rtcomp.units import for_axis

    data = None
    if recording is not None:
        section = chosen.run.recording
        data = read(recording, {**section.map, **mapping}, rate_hz=section.rate)
        chosen.basis()
    else:
        check(chosen, "", *(["judge"] if chosen.run.judge.reference is not None else []))
    with prepare_output(out, force) as work:
        watch = TerminalWatch(["learn", "judge"], quiet=as_json, unit=for_axis("m", chosen.stage.axis))
        try:
            done = run(chosen, data, out=work, watch=watch)
        finally:
            watch.close()
        done.model.save(work / "model.yaml")
        finish(
            out, work, done.config, "identified", identified_rows(done), done.summary(),
            identified_page(done, data.path.name if data is not None else ""), as_json,
        )  # fmt: skip
        if not as_json:
            for note in done.notes:
                click.echo(f"Note: {note}")
        if done.signal is not None:
            raise Interrupted(done.signal, done.notes[-1], results=True)
