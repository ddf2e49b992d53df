"""`rtcomp hil`: a configuration over every link, and faults, against stand-ins for the hardware."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rtcomp_drivers.plant_links import LINKS

from rtcomp.cli.options import Within, force_option, json_option, prepare_output
from rtcomp.cli.runs import lasting, load, to_json

if TYPE_CHECKING:
    from rtcomp.jobs.hil import Verdict

FAULTS = ("kill", "stop", "estop", "unplug", "nan", "jump", "frozen", "silent", "beam")
"""As in rtcomp.jobs.hil_faults, which is not imported for a help text."""


@click.command()
@click.argument("config", type=click.Path(path_type=Path))
@click.option(
    "--link", "links", type=click.Choice(list(LINKS)), multiple=True,
    help="Over this link, once for each; else that of CONFIG's device, else all.",
)  # fmt: skip
@click.option(
    "--fault", "faults", type=click.Choice([*FAULTS, "all", "none"]), multiple=True,
    help="Provoke this, once for each; else kill, stop, estop, unplug.",
)  # fmt: skip
@click.option("--seconds", type=Within(1.0, 1e4), default=10.0, show_default=True, help="Length of each run.")
@click.option(
    "--plant", type=click.Path(path_type=Path), help="Stage file of what moves, instead of CONFIG's stage."
)
@click.option(
    "--watchdog", type=Within(0.02, 5.0), metavar="S", default=0.1, show_default=True,
    help="Of the device, where faults are provoked.",
)  # fmt: skip
@click.option(
    "--patience", type=Within(0.1, 10.0), metavar="S", default=1.0, show_default=True,
    help="Watchdog and oldest sample while identifying and compensating, on a busy machine.",
)  # fmt: skip
@click.option(
    "--at-least", type=Within(1.0, 1e4), metavar="TIMES", default=20.0, show_default=True,
    help="The tracking error must fall by this.",
)  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of noise and moments.")
@click.option("--out", metavar="DIR", type=click.Path(path_type=Path), help="Folder for the recordings.")
@force_option
@json_option
def hil(
    config: Path,
    links: tuple[str, ...],
    faults: tuple[str, ...],
    seconds: float,
    plant: Path | None,
    watchdog: float,
    patience: float,
    at_least: float,
    seed: int,
    out: Path | None,
    force: bool,
    as_json: bool,
) -> int:
    """Identify, compensate and provoke faults over each link in real time, and say what did not hold.

    The stage in CONFIG stands behind the link in a process of its own (`rtcomp plant serve`); no hardware is
    touched, whatever CONFIG names. The exit status is 0 where every verdict holds and 1 where one does not.

    \b
    Examples:
      rtcomp hil configs/leuven.yaml
      rtcomp hil configs/leuven.yaml --link serial --fault all --seconds 5
      rtcomp hil configs/odrive_can.yaml --plant configs/leuven.yaml --at-least 10
    """
    from rtcomp.jobs.hil import friction_in, needed
    from rtcomp.jobs.hil import hil as run
    from rtcomp.jobs.hil_faults import faults_named, jump_size
    from rtcomp.report.terminal import print_verdicts, say
    from rtcomp.report.watch import TerminalWatch
    from rtcomp.units import for_axis

    chosen = lasting(load(config), seconds)
    wanted = faults_named(faults or ("kill", "stop", "estop", "unplug"))
    stage = plant or config
    named = str(chosen.run.device.get("driver"))
    links = tuple(dict.fromkeys(links)) or ((named,) if named in LINKS else tuple(LINKS))
    needed(chosen)
    friction_in(stage)
    if "jump" in wanted:
        jump_size(chosen)

    def tell(verdict: Verdict) -> None:
        mark = "" if verdict.good else "BAD: "
        say(f"{verdict.link}: {mark}{verdict.what}: {verdict.seen}", quiet=as_json)

    with contextlib.ExitStack() as stack:
        work = None if out is None else stack.enter_context(prepare_output(out, force))
        titles = [f"{link} {what}" for link in links for what in ("learn", "without", "with")]
        watch = TerminalWatch(titles, quiet=as_json, unit=for_axis("m", chosen.stage.axis))
        stack.callback(watch.close)
        done = run(
            chosen, stage, links, wanted, watchdog=watchdog, patience=patience, at_least=at_least, seed=seed,
            out=work, watch=watch, tell=tell,
        )  # fmt: skip
        if work is not None:
            (work / "summary.json").write_text(to_json(done.summary()) + "\n")
    if as_json:
        click.echo(to_json(done.summary()))
    else:
        rows = [(v.link, v.what, v.required, v.seen, v.good) for v in done.verdicts]
        bad = sum(not v.good for v in done.verdicts)
        says = "every verdict holds" if done.holds else f"{bad} of {len(rows)} verdicts do not hold"
        print_verdicts(f"{config.name}, {seconds:g} s a run: {says}", rows)
    return 0 if done.holds else 1
