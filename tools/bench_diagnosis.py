"""Diagnoses on recordings with known answers, and on the measured EMPS; how long one takes.

    python tools/bench_diagnosis.py DATA --json diagnosis.json

DATA holds `sealed-dev` (cases with answers.json) and `real/emps/DATA_EMPS.mat`; what is not there is skipped.
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
from figures_table import Figure, show

from rtcomp.diagnosis.diagnose import diagnose
from rtcomp.diagnosis.result import Diagnosis
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.replay import replay
from rtcomp.jobs.simulate import closed_loop
from rtcomp.recording.reader import Recording, read
from rtcomp.stage.stage import Stage

EMPS = {"time": "t", "reference": "qg", "position": "qm", "voltage": "vir"}
RETUNINGS = {
    "friction-reach": "friction.reach",
    "friction-level": "friction.level",
    "viscous-friction": "viscous",
}
ALIASES = {"local-bump": "position-force"}


def found(done: Diagnosis, truth: list[str]) -> bool:
    """Tell whether every concealed effect is named (or retuned), and nothing else is."""
    named = [set(e.names) for e in done.effects if e.names != ("unexplained",)]
    moved = {r.parameter for r in done.retuned}
    for name in truth:
        hit = next((n for n in named if {name, ALIASES.get(name, name)} & n), None)
        if hit is not None:
            named.remove(hit)
        elif RETUNINGS.get(name) not in moved:
            return False
    return not named


def sealed(folder: Path) -> list[Figure]:
    answers: dict[str, Any] = json.loads((folder / "answers.json").read_text())
    right, explained, seconds = 0, [], []
    for case, answer in sorted(answers.items()):
        stage = Stage.load(folder / case / "stage.yaml")
        began = time.perf_counter()
        done = diagnose(stage, [read(folder / case / "train.csv.gz")])
        seconds.append(time.perf_counter() - began)
        right += found(done, answer["effects"])
        if answer["effects"]:
            unseen = read(folder / case / "unseen.csv.gz")
            before = replay(stage, unseen).relative_force_error ** 2 - done.fit.floor**2
            after = max(replay(done.stage, unseen).relative_force_error ** 2 - done.fit.floor**2, 0.0)
            explained.append(100 * (1 - after / before))
    return [
        Figure("sealed-dev: right", float(right), f"of {len(answers)}", f">= {len(answers)}"),
        Figure(
            "sealed-dev: least explained on unseen motion",
            min(explained),
            "%",
            ">= 95",
            "squared error above the floor",
        ),
        Figure("sealed-dev: median explained", float(np.median(explained)), "%"),
        Figure("sealed-dev: seconds, median", float(np.median(seconds)), "s"),
    ]


def emps(path: Path) -> list[Figure]:
    done = diagnose(Stage.load(shipped("emps_belief.yaml")), [read(path, EMPS)])
    named = ", ".join(" or ".join(e.names) for e in done.effects)
    fit = done.fit
    return [
        Figure("EMPS: force error as believed", 100 * fit.before, "%", "", "held-out parts"),
        Figure("EMPS: retuned", 100 * fit.retuned, "%"),
        Figure("EMPS: extended", 100 * fit.after, "%", "<= 3.11", named),
    ]


def pace(seconds: float) -> list[Figure]:
    """So long at 1 kHz of the simulated stage with cogging that the belief lacks."""
    config = Configuration.load(shipped("leuven.yaml"))
    believed = config.stage
    hidden = believed.with_changes(stage={"effects": [{"name": "cogging", "amplitude": 0.4, "period": 1e-4}]})
    motion = {**config.file.data["compensate"]["reference"], "duration": seconds}
    run = closed_loop(config.changed(**hidden.to_dict(), reference=motion))
    columns = {k: run.columns[k] for k in ("time", "reference", "position", "voltage")}
    began = time.perf_counter()
    done = diagnose(believed, [Recording(columns, run.rate_hz)])
    taken = time.perf_counter() - began
    named = ", ".join(" or ".join(e.names) for e in done.effects)
    return [Figure(f"{seconds:g} s at 1 kHz: seconds", taken, "s", f"<= {seconds:g}", named)]


@click.command()
@click.argument("data", required=False, type=click.Path(path_type=Path))
@click.option("--seconds", default=60.0, show_default=True, help="Of the simulated recording.")
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(data: Path | None, seconds: float, path: Path | None) -> None:
    figures = pace(seconds)
    if data is not None and (data / "real/emps/DATA_EMPS.mat").is_file():
        figures += emps(data / "real/emps/DATA_EMPS.mat")
    if data is not None and (data / "sealed-dev/answers.json").is_file():
        figures += sealed(data / "sealed-dev")
    show("Diagnosis", figures, path)


if __name__ == "__main__":
    main()
