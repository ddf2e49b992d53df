"""Compare two ways to diagnose on the same fresh cases of a trial: which is right where the other is not.

Draws a sealed trial, diagnoses it in both ways, and pairs the answers case by case: for each kind of case,
family and strength how many both, only the old, only the new and neither got right, with the exact test on
those where they differ (McNemar 1947: a binomial test with 1/2). Prints a table; ``--json FILE`` writes it.

    python tools/compare_diagnosis.py --cases 80 --seed 7 --old "old/bin/rtcomp diagnose"
    python tools/compare_diagnosis.py --trials out/compare/old out/compare/new
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table
from scipy.stats import binomtest

from rtcomp.cli.options import output_options
from rtcomp.cli.output import prepare_output
from rtcomp.cli.trial import diagnosis_command, known_families
from rtcomp.errors import RtcompError
from rtcomp.report.terminal import Progress
from rtcomp.trial.draw import SHARES
from rtcomp.trial.trial import Settings, trial

Row = Mapping[str, Any]
ASKED: dict[str, Callable[[Row], bool]] = {
    "right": lambda row: bool(row["right"]),
    "no false name": lambda row: not row["fault"] and int(row["wrong"]) == 0,
    "not made worse": lambda row: not row["fault"] and _not_worse(row),
    "answered": lambda row: not row["fault"],
}
"""What is asked of each answer."""


def _not_worse(row: Row) -> bool:
    return row["after"] == "" or float(row["after"]) <= 1.02 * float(row["before"])


@dataclass(frozen=True)
class Paired:
    """How often both ways, one of them and neither did what was asked; p of that difference by chance."""

    asked: str
    group: str
    cases: int
    both: int
    only_old: int
    only_new: int
    neither: int
    p_value: float


def paired(asked: str, group: str, pairs: Sequence[tuple[Row, Row]]) -> Paired:
    """Pair the answers (old, new) of the cases of a group."""
    does = ASKED[asked]
    outcomes = [(does(old), does(new)) for old, new in pairs]
    only_old = outcomes.count((True, False))
    only_new = outcomes.count((False, True))
    differ = only_old + only_new
    p = float(binomtest(only_new, differ, 0.5).pvalue) if differ else 1.0
    return Paired(
        asked, group, len(pairs), outcomes.count((True, True)), only_old, only_new,
        outcomes.count((False, False)), p,
    )  # fmt: skip


def compared(old: Sequence[Row], new: Sequence[Row]) -> list[Paired]:
    """Pair two trials' rows by case, in all and by kind, family and strength."""
    others = {row["case"]: row for row in new}
    pairs = [(row, others[row["case"]]) for row in old if row["case"] in others]
    for one, other in pairs:
        if any(one[key] != other[key] for key in ("kind", "hidden", "share", "family")):
            raise RtcompError(f"{one['case']}: the trials hide other things in it; draw both with one seed")
    if not pairs:
        raise RtcompError("the trials have no case in common")
    groups: dict[str, list[tuple[Row, Row]]] = {"all": pairs}
    for pair in pairs:
        kind = "weak" if pair[0]["tier"] == "weak" else pair[0]["kind"]
        for name in (f"kind: {kind}", f"family: {pair[0]['family']}"):
            groups.setdefault(name, []).append(pair)
        if pair[0]["form"].strip("+"):
            groups.setdefault("in another form", []).append(pair)
        if not pair[0]["detectable"]:
            groups.setdefault("not detectable", []).append(pair)
    order = sorted(groups, key=lambda name: (name != "all", name))
    return [paired(asked, name, groups[name]) for asked in ASKED for name in order]


def show(found: Sequence[Paired], seconds: Mapping[str, float]) -> None:
    console = Console(width=None if sys.stdout.isatty() else 120)
    for asked in ASKED:
        table = Table(title=asked, title_justify="left")
        for heading in ("cases", "of", "both", "only old", "only new", "neither", "p"):
            table.add_column(heading, justify="left" if heading == "cases" else "right", no_wrap=True)
        for row in found:
            if row.asked == asked and (asked == "right" or row.group == "all"):
                table.add_row(
                    row.group, str(row.cases), str(row.both), str(row.only_old), str(row.only_new),
                    str(row.neither), f"{row.p_value:.3g}",
                )  # fmt: skip
        console.print(table)
    console.print(", ".join(f"{name}: median {value:.1f} s a case" for name, value in seconds.items()))


def shown(bar: Progress) -> Callable[[str, int, int], None]:
    return lambda step, done, of: bar.update(done / of, {step: f"{done} of {of}"})


def rows_of(folder: Path) -> list[Row]:
    try:
        rows: list[Row] = json.loads((folder / "trial.json").read_text(encoding="utf-8"))["rows"]
    except (OSError, ValueError, KeyError) as error:
        raise RtcompError(f"{folder}: no trial.json of a trial that ended") from error
    return rows


def median_seconds(rows: Sequence[Row]) -> float:
    times = sorted(float(row["seconds"]) for row in rows)
    return times[len(times) // 2]


@click.command(help=__doc__.split("\n\n")[0] if __doc__ else None)
@click.option("--cases", type=click.IntRange(1, 100_000), default=40, show_default=True)
@click.option("--seed", type=click.IntRange(0, 2**62), default=0, show_default=True)
@click.option("--only", type=click.Choice(list(SHARES)), help="Cases of this kind and no others.")
@click.option("--family", "families", metavar="NAME", multiple=True, help="Default all.")
@click.option("--forms", type=click.FloatRange(0.0, 1.0), help="Share of effects in another form.")
@click.option("--old", metavar="COMMAND", help="Instead of `rtcomp diagnose`, for the old way.")
@click.option("--new", metavar="COMMAND", help="Instead of `rtcomp diagnose`, for the new way.")
@click.option("--jobs", type=click.IntRange(1, 1024), help="Processes at a time; default one a core.")
@click.option("--timeout", type=click.FloatRange(1.0, 1e5), default=900.0, show_default=True, help="s.")
@click.option("--keep", is_flag=True, help="Keep recordings and diagnoses.")
@click.option("--trials", nargs=2, type=click.Path(path_type=Path), metavar="OLD NEW",
              help="Pair two trials that ended, and draw none.")  # fmt: skip
@click.option("--json", "target", type=click.Path(path_type=Path))
@output_options("out/compare")
def main(
    cases: int, seed: int, only: str | None, families: tuple[str, ...], forms: float | None,
    old: str | None, new: str | None, jobs: int | None, timeout: float, keep: bool,
    trials: tuple[Path, Path] | None, target: Path | None, out: Path, force: bool,
) -> None:  # fmt: skip
    if trials is None:
        chosen = known_families(families)
        replay = (sys.executable, "-m", "rtcomp.cli.main", "replay")
        ways = {"old": diagnosis_command(old), "new": diagnosis_command(new)}
        with prepare_output(out, force) as work:
            for name, command in ways.items():
                (work / name).mkdir(parents=True)
                settings = Settings(
                    cases, seed, jobs or os.cpu_count() or 1, command, replay, timeout, (), only, chosen,
                    forms,
                )  # fmt: skip
                with Progress(name) as bar:
                    trial(settings, work / name, shown(bar), keep)
        trials = (out / "old", out / "new")
    rows = {name: rows_of(folder) for name, folder in zip(("old", "new"), trials, strict=True)}
    found = compared(rows["old"], rows["new"])
    seconds = {name: median_seconds(each) for name, each in rows.items()}
    show(found, seconds)
    if target is not None:
        content = {"seconds_median": seconds, "paired": [asdict(row) for row in found]}
        target.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    try:
        main()
    except RtcompError as error:
        sys.exit(f"error: {error}")
