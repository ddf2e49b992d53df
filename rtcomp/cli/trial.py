"""`rtcomp trial`: sealed cases, diagnosed by other processes, opened and scored."""

from __future__ import annotations

import math
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rtcomp.cli.options import json_option, output_options
from rtcomp.cli.output import prepare_output
from rtcomp.cli.runs import to_json

if TYPE_CHECKING:
    from rtcomp.trial.figures import Figure
    from rtcomp.trial.trial import Trial


@click.command()
@click.option("--cases", type=click.IntRange(1, 100_000), default=40, show_default=True, help="How many.")
@click.option("--seed", type=click.IntRange(0, 2**62), default=0, show_default=True, help="What is drawn.")
@click.option(
    "--only",
    type=click.Choice(["one", "two", "outside", "clean", "retuned"]),
    help="Cases of this kind and no others: false alarms of one in a hundred take hundreds of clean ones.",
)
@click.option(
    "--resume", metavar="DIR", type=click.Path(path_type=Path),
    help="Go on with a trial that was stopped: where it was kept. Its cases, seed and kind count.",
)  # fmt: skip
@output_options("out/trial")
@click.option("--jobs", type=click.IntRange(1, 1024), help="Processes at a time; default one a core.")
@click.option("--keep", is_flag=True, help="Keep recordings, diagnoses and replays, not only the scores.")
@click.option(
    "--timeout", type=click.FloatRange(1.0, 1e5), default=900.0, show_default=True, help="s a case."
)
@click.option(
    "--rivals", type=click.Choice(["all", "none"]), default="all", show_default=True,
    help="FROLS and SINDy on the same cases, where they are installed.",
)  # fmt: skip
@click.option("--diagnose", "command", metavar="COMMAND", help="Instead of `rtcomp diagnose`.")
@json_option
def trial(
    cases: int,
    seed: int,
    only: str | None,
    resume: Path | None,
    out: Path,
    force: bool,
    jobs: int | None,
    keep: bool,
    timeout: float,
    rivals: str,
    command: str | None,
    as_json: bool,
) -> None:
    """Prove the diagnosis on cases whose answers are sealed until it is done.

    Plants, hidden effects, noise and beliefs are drawn by a simulator that shares no physics with the
    program; answers are committed to, diagnoses run in processes of their own, and only then are answers
    opened and scored. Leaves trial.json, rows.csv, commitments.json and answers.json. A trial that is
    interrupted says where it is kept; --resume goes on from there.

    \b
    Example:
      rtcomp trial --cases 40 --seed 1 --out out/trial
    """
    from rtcomp.report.terminal import Progress
    from rtcomp.trial.rival import RIVALS
    from rtcomp.trial.stopped import Stopped
    from rtcomp.trial.trial import Settings
    from rtcomp.trial.trial import trial as run

    here = (sys.executable, "-m", "rtcomp.cli.main")
    diagnose = tuple(shlex.split(command)) if command else (*here, "diagnose")
    chosen = tuple(RIVALS) if rivals == "all" else ()
    if resume is not None:
        so_far = Stopped.read(resume)
        cases, seed, only = so_far.cases, so_far.seed, so_far.only
    settings = Settings(
        cases, seed, jobs or os.cpu_count() or 1, diagnose, (*here, "replay"), timeout, chosen, only
    )
    with prepare_output(out, force) as work, Progress("trial", quiet=as_json) as bar:
        done = run(
            settings, work, lambda step, n, of: bar.update(n / of, {step: f"{n} of {of}"}), keep, resume
        )
        content = done.to_json(settings)
    if as_json:
        click.echo(to_json({**content, "out": str(out)}))
        return
    _show(done, out)


def _show(done: Trial, out: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{len(done.rows)} sealed cases", title_justify="left")
    for name, side in (("score", "left"), ("rtcomp", "right"), ("of", "right"), ("wanted", "right")):
        table.add_column(name, justify=side, no_wrap=True)  # type: ignore[arg-type]
    for rival in done.rivals:
        table.add_column(rival, justify="right")
    others = {rival: {f.name: f for f in found} for rival, found in done.rivals.items()}
    for figure in done.figures:
        mark = {True: "met", False: "NOT met", None: ""}[figure.met]
        table.add_row(
            figure.name, _number(figure), str(figure.count), f"{_wanted(figure)} {mark}".strip(),
            *(_number(found[figure.name]) if figure.name in found else "" for found in others.values()),
        )  # fmt: skip
    console = Console(width=None if sys.stdout.isatty() else 140)
    console.print(table)
    for tier in done.seen:
        if tier.cases:
            console.print(
                f"{tier.tier} strength: {tier.found} of {tier.cases} lone effects found; smallest seen "
                f"{_percent(tier.smallest)} of the motion's force, all from {_percent(tier.surely)} on"
            )
    for note in done.notes:
        console.print(f"Note: {note}", markup=False)
    console.print(f"{done.seconds:.0f} s; rows in {out / 'rows.csv'}, all in {out / 'trial.json'}")


def _percent(value: float) -> str:
    return "none" if math.isnan(value) else f"{100.0 * value:.2g} %"


def _number(figure: Figure) -> str:
    if figure.count == 0:
        return "-"
    if not figure.part:
        return f"{figure.value:.3g} {figure.unit}".strip()
    low, high = figure.interval or (0.0, 1.0)
    return f"{100.0 * figure.value:.1f} % ({100.0 * low:.0f}-{100.0 * high:.0f})"


def _wanted(figure: Figure) -> str:
    if figure.wanted is None:
        return ""
    low, high = figure.wanted

    def one(value: float) -> Any:
        return f"{100.0 * value:g} %" if figure.part else f"{value:g}"

    if low == high:
        return str(one(low))
    if low == 0.0:
        return f"<= {one(high)}"
    if high == (1.0 if figure.part else math.inf):
        return f">= {one(low)}"
    return f"{one(low)} to {one(high)}"
