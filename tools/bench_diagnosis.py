"""Diagnoses on recordings with known answers, and on the measured EMPS; how long one takes, and how much.

    python tools/bench_diagnosis.py DATA --json diagnosis.json

Time and memory are those of the installed command, from the start of its process: until the place of the
mismatch stands on the terminal, and until the end. `--pairs` adds two effects at a time, which take longest
to tell, `--minutes 60` an hour at 10 kHz. DATA holds `sealed-dev` (cases with answers.json),
`real/emps/DATA_EMPS.mat` and
`real/heads-yaw/yaw_sine_to_330s.csv.gz`; what is not there is skipped.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
from figures_table import Figure, show
from on_terminal import Shown, on_terminal

from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.result import Diagnosis
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import identify
from rtcomp.jobs.replay import replay
from rtcomp.jobs.simulate import closed_loop
from rtcomp.recording.reader import read
from rtcomp.recording.writer import write_csv
from rtcomp.stage.stage import Stage
from rtcomp.yamlfile import dump_yaml

EMPS = {"time": "t", "reference": "qg", "position": "qm", "voltage": "vir"}
RETUNINGS = {
    "friction-reach": "friction.reach",
    "friction-level": "friction.level",
    "viscous-friction": "viscous",
}
COGGING: dict[str, Any] = {"name": "cogging", "amplitude": 0.4, "period": 1e-4}
PAIRS: list[list[dict[str, Any]]] = [
    [
        {"name": "stribeck", "rise": 0.4, "velocity": 9e-4},
        {"name": "parallel-spring", "stiffness": 2400.0},
    ],
    [
        {"name": "backlash", "gap": 8e-6, "share": 0.6},
        {"name": "stiction-ageing", "growth": 0.3, "distance": 1e-5},
    ],
    [
        COGGING,
        {"name": "load-dependent-friction", "coefficient": 0.3},
    ],
]
"""Hidden together: two that hide in each other, two that change friction's memory, waves and load."""
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


def yaw(path: Path) -> list[Figure]:
    """From the Maxwell-slip model that rtcomp identifies on the smaller amplitudes, what differs on all."""
    config = Configuration.load(shipped("heads_yaw.yaml"))
    data = read(path, config.run.recording.map)
    model = identify(config, data).model.to_dict()
    friction = {key: model[key] for key in ("model", "widths", "weights")}
    stage = config.stage.with_changes(stage={"friction": friction})
    belief = {**stage.to_dict(), "sensor": {"noise": 5e-6, "resolution": 2.4e-5}}
    done = diagnose(Stage.from_dict(belief), [data])
    named = ", ".join(" or ".join(e.names) for e in done.effects) or done.verdict
    fit = done.fit
    return [
        Figure("heads-yaw: force error as identified", 100 * fit.before, "%", "", "held-out parts"),
        Figure("heads-yaw: retuned", 100 * fit.retuned, "%"),
        Figure("heads-yaw: extended", 100 * fit.after, "%", "", named),
        Figure("heads-yaw: noise alone", 100 * fit.floor, "%"),
    ]


def hidden(
    rate: float, seconds: float, effects: list[dict[str, Any]]
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return the shipped stage at `rate`, and a recording of it with `effects` that it lacks."""
    config = Configuration.load(shipped("leuven.yaml"))
    belief = {**config.stage.to_dict(), "rate": rate}
    true = config.stage.with_changes(stage={"effects": effects})
    motion = {**config.file.data["compensate"]["reference"], "duration": seconds}
    run = closed_loop(config.changed(**{**true.to_dict(), "rate": rate}, reference=motion))
    return belief, {k: run.columns[k] for k in ("time", "reference", "position", "voltage")}


def command(folder: Path, recording: str, belief: dict[str, Any]) -> Shown:
    dump_yaml(folder / "stage.yaml", belief)
    rtcomp = str(Path(sys.executable).parent / "rtcomp")
    return on_terminal(
        [rtcomp, "diagnose", str(folder / recording), "--stage", str(folder / "stage.yaml"),
         "--out", str(folder / "out")],
        "Where ", "Missing: ",
    )  # fmt: skip


def pairs(seconds: float, folder: Path) -> list[Figure]:
    """So long at 1 kHz of the simulated stage with two effects that the belief lacks, as CSV."""
    found = []
    for effects in PAIRS:
        belief, columns = hidden(1000.0, seconds, effects)
        write_csv(folder / "run.csv", columns, True)
        shown = command(folder, "run.csv", belief)
        shutil.rmtree(folder / "out")
        what = " and ".join(str(e["name"]) for e in effects)
        found.append(Figure(f"{seconds:g} s at 1 kHz, {what}", shown.seconds, "s", "<= 60", verdict(shown)))
    return found


def verdict(shown: Shown) -> str:
    """Return the sentence in which a diagnosis ended, with a word where its budget cut it short."""
    said = re.search("(Missing: |Something |Nothing |No physics )[^\r]*", shown.text)
    if said is None:
        raise SystemExit(f"bench_diagnosis: no verdict in what the command printed:\n{shown.text}")
    return said[0] + (" (cut short)" if "not tried within" in shown.text else "")


def pace(seconds: float, folder: Path) -> list[Figure]:
    """So long at 1 kHz of the simulated stage with cogging that the belief lacks, as CSV."""
    belief, columns = hidden(1000.0, seconds, [COGGING])
    write_csv(folder / "run.csv", columns, True)
    command(folder, "run.csv", belief)  # kernels compiled, once for all
    shutil.rmtree(folder / "out")
    shown = command(folder, "run.csv", belief)
    what = f"{seconds:g} s at 1 kHz"
    return [
        Figure(
            f"{what}: where, on the terminal after",
            shown.when["Where "],
            "s",
            "<= 2",
            "process start included",
        ),
        Figure(f"{what}: everything", shown.seconds, "s", "<= 60", verdict(shown)),
    ]


def fast(folder: Path, minutes: int, rate: float = 1e4, stretch: float = 60.0) -> list[Figure]:
    """So many minutes at 10 kHz: one of steady motion over and over, with fresh noise, as HDF5."""
    import h5py

    settling = 10.0  # a whole period of the motion, as `stretch` is
    belief, columns = hidden(rate, settling + stretch, [COGGING])
    rows = int(stretch * rate)
    chance = np.random.default_rng(1)
    with h5py.File(folder / "fast.h5", "w") as file:
        for name, column in columns.items():
            file.create_dataset(name, (minutes * rows,), dtype="f8")
            for k in range(minutes):
                part = column[-rows:].copy()
                if name == "time":
                    part = (k * rows + np.arange(rows)) / rate
                elif name == "position":
                    part += 5e-9 * chance.standard_normal(rows)
                file[name][k * rows : (k + 1) * rows] = part
    shown = command(folder, "fast.h5", belief)
    what = f"{minutes:g} min at {rate / 1000:g} kHz"
    return [
        Figure(f"{what}: memory", shown.peak_bytes / 1e9, "GB", "<= 4", f"{minutes * rows} rows"),
        Figure(f"{what}: where, on the terminal after", shown.when["Where "], "s"),
        Figure(f"{what}: everything", shown.seconds, "s", "", verdict(shown)),
    ]


@click.command()
@click.argument("data", required=False, type=click.Path(path_type=Path))
@click.option("--seconds", default=60.0, show_default=True, help="Of the simulated recording.")
@click.option("--pairs", "both", is_flag=True, help="Two effects at a time too.")
@click.option(
    "--minutes", type=click.IntRange(0), default=0, help="So many at 10 kHz too; an hour needs 2 GB of disk."
)
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(data: Path | None, seconds: float, both: bool, minutes: int, path: Path | None) -> None:
    with tempfile.TemporaryDirectory() as folder:
        figures = pace(seconds, Path(folder))
    if both:
        with tempfile.TemporaryDirectory() as folder:
            figures += pairs(seconds, Path(folder))
    if minutes:
        with tempfile.TemporaryDirectory() as folder:
            figures += fast(Path(folder), minutes)
    if data is not None and (data / "real/emps/DATA_EMPS.mat").is_file():
        figures += emps(data / "real/emps/DATA_EMPS.mat")
    if data is not None and (data / "real/heads-yaw/yaw_sine_to_330s.csv.gz").is_file():
        figures += yaw(data / "real/heads-yaw/yaw_sine_to_330s.csv.gz")
    if data is not None and (data / "sealed-dev/answers.json").is_file():
        figures += sealed(data / "sealed-dev")
    show("Diagnosis", figures, path)


if __name__ == "__main__":
    main()
