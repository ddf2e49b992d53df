"""`rtcomp trial`: sealed cases, diagnosed by other processes, opened and scored."""

from __future__ import annotations

import math
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rtcomp.cli.options import json_option, output_options
from rtcomp.cli.output import prepare_output
from rtcomp.cli.runs import to_json

if TYPE_CHECKING:
    from rich.table import Table as RichTable

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
    "--family",
    "families",
    metavar="NAME",
    multiple=True,
    help="Cases of this family of axes; may be given several times. Default all, each with the same weight.",
)
@click.option(
    "--forms",
    metavar="SHARE",
    type=click.FloatRange(0.0, 1.0),
    help="Share of effects hidden in another form, of those that have one; by default that of the family.",
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
    families: tuple[str, ...],
    forms: float | None,
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

    Plants of several families, hidden effects, noise and beliefs are drawn by a simulator that shares no
    physics with the program; answers are committed to, diagnoses run in processes of their own, and only
    then are answers opened and scored. Leaves trial.json, rows.csv, commitments.json and answers.json. A
    trial that is interrupted says where it is kept; --resume goes on from there.

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
    chosen = tuple(RIVALS) if rivals == "all" else ()
    families = known_families(families)
    if resume is not None:
        so_far = Stopped.read(resume)
        cases, seed, only = so_far.cases, so_far.seed, so_far.only
        families, forms = tuple(so_far.families), so_far.forms
    settings = Settings(
        cases, seed, jobs or os.cpu_count() or 1, diagnosis_command(command), (*here, "replay"),
        timeout, chosen, only, families, forms,
    )  # fmt: skip
    with prepare_output(out, force) as work, Progress("trial", quiet=as_json) as bar:
        done = run(
            settings, work, lambda step, n, of: bar.update(n / of, {step: f"{n} of {of}"}), keep, resume
        )
        content = done.to_json(settings)
    if as_json:
        click.echo(to_json({**content, "out": str(out)}))
        return
    _show(done, out)


def known_families(names: Sequence[str]) -> tuple[str, ...]:
    """Return the families of these names, all where there are none; raise RtcompError for an unknown one."""
    from rtcomp.errors import RtcompError, nearest
    from rtcomp.trial.families import FAMILIES

    for name in names:
        if name not in FAMILIES:
            raise RtcompError(f"no family is named {name!r}; {nearest(name, list(FAMILIES))}")
    return tuple(names) or tuple(FAMILIES)


def diagnosis_command(command: str | None = None) -> tuple[str, ...]:
    """Return the command that diagnoses, or `command`; recording, stage and output are still to be added."""
    if command:
        return tuple(shlex.split(command))
    return (sys.executable, "-m", "rtcomp.cli.main", "diagnose")


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
    if len(done.families) > 1:
        console.print(_by_family(done))
    console.print(_stated(done))
    for tier in done.seen:
        if tier.cases:
            console.print(
                f"{tier.tier} strength: {tier.found} of {tier.cases} lone effects found; smallest seen "
                f"{_percent(tier.smallest)} of the motion's force, all from {_percent(tier.surely)} on"
            )
    for note in done.notes:
        console.print(f"Note: {note}", markup=False)
    console.print(f"{done.seconds:.0f} s; rows in {out / 'rows.csv'}, all in {out / 'trial.json'}")


SHOWN = {
    "right, all cases": "right",
    "named first, one effect": "one: first",
    "false name beside one effect": "one: false name",
    "both of two named": "both of two",
    "false alarm on clean": "clean: alarm",
    "outside called unexplained": "outside: unexplained",
    "outside misnamed": "outside: name",
}
"""Figures that the table of families shows, and their headings."""


def _by_family(done: Trial) -> RichTable:
    from rich.table import Table

    from rtcomp.trial.figures import figures

    table = Table(title="By family: percent (cases)", title_justify="left")
    table.add_column("family", no_wrap=True)
    for heading in ("cases", *SHOWN.values()):
        table.add_column(heading, justify="right")
    for name, rows in done.families.items():
        found = {f.name: f for f in figures(rows)}
        cells = [
            f"{100.0 * found[key].value:.0f} ({found[key].count})" if found[key].count else "-"
            for key in SHOWN
        ]
        table.add_row(name, str(len(rows)), *cells)
    return table


def _stated(done: Trial) -> RichTable:
    from rich.table import Table

    from rtcomp.trial.calibration import calibration

    table = Table(title="Names by stated probability", title_justify="left")
    for heading in ("stated", "mean", "right", "of"):
        table.add_column(heading, justify="left" if heading == "stated" else "right", no_wrap=True)
    for stated in calibration(done.rows):
        mean = "-" if stated.mean is None else f"{stated.mean:.3f}"
        table.add_row(stated.says, mean, _number(stated.figure), str(stated.count))
    return table


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
