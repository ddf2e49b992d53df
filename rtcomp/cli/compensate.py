"""`rtcomp compensate`: follow a reference with the friction cancelled, beside the same without."""

from __future__ import annotations

from pathlib import Path

import click

from rtcomp.cli.options import Within, json_option, output_options
from rtcomp.cli.output import prepare_output
from rtcomp.cli.runs import device_options, finish, load
from rtcomp.errors import Interrupted


@click.command()
@click.argument("config", type=click.Path(path_type=Path))
@click.option(
    "--model", type=click.Path(path_type=Path), help="Model file of `rtcomp identify`; else identified first."
)
@click.option(
    "--stage", "stage_file", type=click.Path(path_type=Path),
    help="Stage file, of `rtcomp diagnose` for one, whose whole chain is fed forward instead of a model.",
)  # fmt: skip
@output_options("out/compensate")
@device_options
@click.option("--seconds", type=Within(0.1, 1e6), help="Length of each run, instead of the file's.")
@json_option
def compensate(
    config: Path,
    model: Path | None,
    stage_file: Path | None,
    out: Path,
    force: bool,
    port: str | None,
    clock: str | None,
    armed: bool,
    allow_non_rt: bool,
    stop_file: Path | None,
    seconds: float | None,
    as_json: bool,
) -> None:
    """Follow the reference in CONFIG twice, without and with feedforward of the friction.

    The folder holds without.h5 and with.h5, the model or the stage, the configuration as run, summary.json
    and report.html.

    \b
    Examples:
      rtcomp compensate configs/leuven.yaml --stage stage.yaml --out out/tracking
      rtcomp compensate configs/leuven.yaml --model out/leuven/model.yaml --out out/tracking
      rtcomp compensate configs/leuven.yaml --port /dev/ttyACM0 --armed --model out/board/model.yaml
    """
    from rtcomp.hysteresis.model import HysteresisModel
    from rtcomp.jobs.compensate import check_stage
    from rtcomp.jobs.compensate import compensate as run
    from rtcomp.jobs.identify import identify
    from rtcomp.jobs.session import check
    from rtcomp.report.pages import compensated_page, compensated_rows
    from rtcomp.report.watch import TerminalWatch
    from rtcomp.stage.stage import Stage
    from rtcomp.units import for_axis

    if model is not None and stage_file is not None:
        raise click.UsageError("--model and --stage are both given; feed forward the one or the other")
    chosen = load(
        config, port=port, clock=clock, seconds=seconds, armed=armed, allow_non_rt=allow_non_rt,
        stop_file=stop_file,
    )  # fmt: skip
    known = HysteresisModel.load(model) if model is not None else None
    stage = Stage.load(stage_file) if stage_file is not None else None
    if stage is not None:
        check_stage(chosen, stage)
    elif known is None:
        chosen.identify  # noqa: B018 -- raises where the section is missing
    ready = known is not None or stage is not None
    check(chosen, *([] if ready else ["", "judge"]), "compensate")
    with prepare_output(out, force) as work:
        titles = ["without", "with"] if ready else ["learn", "judge", "without", "with"]
        watch = TerminalWatch(titles, quiet=as_json, unit=for_axis("m", chosen.stage.axis))
        try:
            if not ready:
                learned = identify(chosen, out=work, watch=watch)
                if learned.signal is not None:
                    raise Interrupted(learned.signal, learned.notes[-1])
                known = learned.model
            done = run(chosen, known, stage=stage, out=work, watch=watch)
        finally:
            watch.close()
        if done.model is not None:
            done.model.save(work / "model.yaml")
        if done.stage is not None:
            done.stage.save(work / "stage.yaml")
        finish(
            out, work, chosen, "compensated", compensated_rows(done), done.summary(), compensated_page(done),
            as_json,
        )  # fmt: skip
        if not as_json:
            for note in done.notes:
                click.echo(f"Note: {note}")
