"""`rtcomp diagnose`: recording and simulation in, missing physics out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import click

from rtcomp.cli.options import json_option, map_option, output_options, rate_option
from rtcomp.cli.output import prepare_output
from rtcomp.cli.runs import to_json

if TYPE_CHECKING:
    from rtcomp.diagnosis.result import Place
    from rtcomp.report.terminal import Progress


COLUMNS = ("time", "position", "voltage", "reference", "enabled", "status", "overrun", "gap", "outlier")
"""What a diagnosis looks at of a recording."""


@click.command()
@click.argument(
    "recordings", nargs=-1, required=True, metavar="RECORDING...", type=click.Path(path_type=Path)
)
@click.option(
    "--stage", "stage_file", required=True, type=click.Path(path_type=Path),
    help="What the simulation believes: a stage file or a configuration.",
)  # fmt: skip
@output_options("out/diagnose")
@map_option
@rate_option
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the random draws.")
@click.option(
    "--input", "between", type=click.Choice(["held", "band-limited"]),
    help="What the command does between rows; both are tried where it is not said.",
)  # fmt: skip
@click.option(
    "--budget", type=click.FloatRange(0.0, min_open=True), default=60.0, show_default=True, metavar="SECONDS",
    help="Ends the search with the best answer so far; compiling, once on a machine, is not counted.",
)  # fmt: skip
@click.option(
    "--assume-units", is_flag=True,
    help="Where a column looks to be in another unit than SI, take it so, and say it.",
)  # fmt: skip
@json_option
def diagnose(
    recordings: tuple[Path, ...],
    stage_file: Path,
    out: Path,
    force: bool,
    mapping: dict[str, str],
    rate: float | None,
    seed: int,
    between: str | None,
    budget: float,
    assume_units: bool,
    as_json: bool,
) -> None:
    """Say where the stage and the RECORDINGs differ, which physics is missing, and what it explains.

    The folder holds diagnosis.json, stage.yaml (the stage with what was found, ready to simulate, replay and
    compensate), reference.yaml (the next experiment, where one would tell more) and report.html. The exit
    status is 0 whatever the verdict.

    \b
    Examples:
      rtcomp diagnose run.h5 --stage configs/leuven.yaml --out out/diagnosis
      rtcomp diagnose a.csv b.csv --stage stage.yaml --map position=qm --map voltage=vir
    """
    import time
    from dataclasses import replace

    began = time.monotonic()  # reading the recordings is part of the budget
    from rtcomp.diagnosis.forces.readings import in_si_units
    from rtcomp.diagnosis.recordings.admit import admit
    from rtcomp.recording.acted import as_acted
    from rtcomp.recording.driven import driven
    from rtcomp.recording.reader import read
    from rtcomp.stage.stage import Stage

    stage = Stage.load(stage_file)
    read_ones = [as_acted(read(path, mapping, rate_hz=rate, only=COLUMNS)) for path in recordings]
    data = [part for one in read_ones for part in driven(one)]
    data, assumed = in_si_units(stage, data, assume=assume_units)
    several = len(data) > 1
    notes = [f"in {r.path.name}: {note}" if several else note for r in data for note in r.notes]
    notes += [*assumed, *admit(stage, data)]

    from rtcomp.diagnosis.pipeline import diagnose as diagnosed
    from rtcomp.report.diagnosis_page import diagnosed_page
    from rtcomp.report.page import write_page
    from rtcomp.yamlfile import dump_yaml, write_text

    with prepare_output(out, force) as work:
        with Steps(quiet=as_json) as steps:
            held = None if between is None else between == "held"
            found = diagnosed(
                stage, data, held=held, budget=budget, began=began, seed=seed, located=steps.located,
                progress=lambda done, name: steps.update(name, done),
            )  # fmt: skip
        found = replace(found, notes=list(dict.fromkeys([*notes, *found.notes])))
        text = to_json(found.to_json())
        write_text(work / "diagnosis.json", text + "\n")
        found.stage.save(work / "stage.yaml")
        if found.next_experiment is not None:
            dump_yaml(work / "reference.yaml", {"reference": found.next_experiment.reference})
        names = [path.name for path in recordings]
        write_page(work / "report.html", diagnosed_page(found, names, stage_file.name, str(out)))
    if as_json:
        click.echo(to_json({**found.to_json(), "out": str(out)}))
        return
    from rtcomp.report.diagnosis_text import diagnosis_text

    click.echo(diagnosis_text(found, str(out)))
    for note in found.notes:
        click.echo(f"Note: {note}")
    click.echo(f"Report: {out / 'report.html'}")


class Steps:
    """A line of progress for each step of the diagnosis, one after the other; the place when it is known."""

    def __init__(self, *, quiet: bool) -> None:
        self._quiet = quiet
        self._name = ""
        self._line: Progress | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def update(self, name: str, done: float, **figures: Any) -> None:
        """Say that the share `done` (0 to 1) of the step `name` is finished; another name begins its line."""
        from rtcomp.report.terminal import Progress

        if self._line is None or name != self._name:
            self._close()
            self._name, self._line = name, Progress(f"{name:<8}", quiet=self._quiet)
            self._line.__enter__()
        self._line.update(done, figures or None)

    def located(self, left: float, places: Sequence[Place]) -> None:
        """Say where the mismatch shows, while its name is still looked for."""
        from rtcomp.report.diagnosis_text import where_so_far
        from rtcomp.report.terminal import say

        self._close()
        say(where_so_far(left, places), quiet=self._quiet)

    def _close(self) -> None:
        if self._line is not None:
            line, self._line = self._line, None
            line.__exit__(None, None, None)
