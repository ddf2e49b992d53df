"""Drawn pairs of stage and recording, most of them damaged: one answer or one clear line each.

    python tools/bench_answers.py --pairs 500 --jobs 2 --json answers.json

Stages are those of the trial's families, as believed, thin, or wrong; recordings are cut short, coarse,
clipped, at rest, in another unit, without a reference, with rows and cells that are lost or repeated. Each
pair goes through the installed `rtcomp diagnose`. It must end in an answer (status 0, a verdict) or in one
line that says what is wrong (status 2), and within its budget; what did not is listed.
"""

from __future__ import annotations

import copy
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
import yaml
from figures_table import Figure, show

from rtcomp.trial.draw import draw, plan
from rtcomp.trial.families import FAMILIES

Columns = dict[str, np.ndarray]
Stage = dict[str, Any]
ONCE, TWICE = 0.6, 0.2
"""Part of the stages, and of the recordings, that are damaged; in two ways."""
PATIENCE = 10.0
"""Budgets after which a command that has not ended is taken to hang."""


# -- stages -------------------------------------------------------------------------------------------------


def thin(stage: Stage, _chance: np.random.Generator) -> None:
    """Keep what no stage can lack."""
    stage["stage"] = {
        k: v for k, v in stage["stage"].items() if k in ("axis", "mass", "force_constant", "voltage_limit")
    }


def no_friction(stage: Stage, _chance: np.random.Generator) -> None:
    """Believe in none."""
    stage["stage"]["friction"] = []


def no_sensor(stage: Stage, _chance: np.random.Generator) -> None:
    """Say nothing of the sensor."""
    stage.pop("sensor", None)


def other_size(stage: Stage, chance: np.random.Generator) -> None:
    """Believe a number that is off by up to a factor of a thousand."""
    keys = [k for k, v in stage["stage"].items() if isinstance(v, float)]
    stage["stage"][str(chance.choice(keys))] *= float(10.0 ** chance.uniform(-3.0, 3.0))


def out_of_bounds(stage: Stage, chance: np.random.Generator) -> None:
    """Believe in an effect beyond what physics allows, or with a number that is none."""
    entries: list[dict[str, Any]] = [
        {"name": "drive-deadband", "width": -0.3},
        {"name": "cogging", "amplitude": 1.0, "period": 0.0},
        {"name": "backlash", "gap": float("nan")},
        {"name": "no-such-effect"},
    ]
    stage["stage"]["effects"] = [entries[int(chance.integers(len(entries)))]]


# -- recordings ---------------------------------------------------------------------------------------------


def short(columns: Columns, chance: np.random.Generator) -> Columns:
    """Keep the first moments, at least a row."""
    rows = max(1, int(columns["time"].size * 10.0 ** chance.uniform(-4.0, -0.3)))
    return {k: v[:rows] for k, v in columns.items()}


def coarse(columns: Columns, chance: np.random.Generator) -> Columns:
    """Read the position by a handful of counts."""
    step = np.ptp(columns["position"]) / chance.integers(1, 60)
    return {**columns, "position": step * np.round(columns["position"] / max(step, 1e-300))}


def clipped(columns: Columns, chance: np.random.Generator) -> Columns:
    """Cut a column at a part of its range."""
    name = str(chance.choice(["position", "voltage"]))
    most = np.abs(columns[name]).max() * chance.uniform(0.01, 0.8)
    return {**columns, name: np.clip(columns[name], -most, most)}


def at_rest(columns: Columns, chance: np.random.Generator) -> Columns:
    """Let the reading, or the command, stand still from a moment on."""
    name = str(chance.choice(["position", "voltage"]))
    still = columns[name].copy()
    first = int(still.size * chance.choice([0.0, 0.3, 0.8]))
    still[first:] = still[first]
    return {**columns, name: still}


def other_unit(columns: Columns, chance: np.random.Generator) -> Columns:
    """Give a column in another unit."""
    name = str(chance.choice(["position", "position", "voltage", "time"]))
    factor = float(chance.choice({"time": [1e3, 1e6]}.get(name, [1e3, 1e6, 1e-3, 180.0 / np.pi])))
    both = ("position", "reference") if name == "position" else (name,)
    return {k: v * factor if k in both else v for k, v in columns.items()}


def open_loop(columns: Columns, _chance: np.random.Generator) -> Columns:
    """Leave the reference out."""
    return {k: v for k, v in columns.items() if k != "reference"}


def lost(columns: Columns, chance: np.random.Generator) -> Columns:
    """Lose single rows, or all of a stretch."""
    kept = chance.random(columns["time"].size) > chance.choice([1e-3, 0.05, 0.5])
    first = int(chance.integers(kept.size))
    kept[first : first + int(chance.integers(kept.size // 4 + 1))] = chance.random() < 0.5
    kept[0] = True
    return {k: v[kept] for k, v in columns.items()}


def no_numbers(columns: Columns, chance: np.random.Generator) -> Columns:
    """Put cells that are no numbers, or far too large, into a column."""
    name = str(chance.choice(list(columns)))
    cells = columns[name].copy()
    where = chance.integers(cells.size, size=int(chance.choice([1, 20, cells.size])))
    cells[where] = chance.choice([np.nan, np.inf, 1e30])
    return {**columns, name: cells}


def restarted(columns: Columns, chance: np.random.Generator) -> Columns:
    """Let time jump back, as where two logs were put together."""
    clock = columns["time"].copy()
    clock[int(chance.integers(clock.size)) :] -= chance.uniform(0.0, 2.0) * clock[-1]
    return {**columns, "time": clock}


def noisy(columns: Columns, chance: np.random.Generator) -> Columns:
    """Add noise of up to the size of the motion."""
    size = np.ptp(columns["position"]) * 10.0 ** chance.uniform(-5.0, 0.0)
    noise = size * chance.standard_normal(columns["position"].size)
    return {**columns, "position": columns["position"] + noise}


def turned(columns: Columns, chance: np.random.Generator) -> Columns:
    """Turn the sign of a column."""
    name = str(chance.choice(["position", "voltage"]))
    return {**columns, name: -columns[name]}


def swapped(columns: Columns, _chance: np.random.Generator) -> Columns:
    """Take position and command for each other."""
    return {**columns, "position": columns["voltage"], "voltage": columns["position"]}


STAGES: list[Callable[[Stage, np.random.Generator], None]] = [
    thin, no_friction, no_sensor, other_size, out_of_bounds,
]  # fmt: skip
RECORDINGS: list[Callable[[Columns, np.random.Generator], Columns]] = [
    short, coarse, clipped, at_rest, other_unit, open_loop, lost, no_numbers, restarted, noisy, turned,
    swapped,
]  # fmt: skip


# -- pairs --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pair:
    """A stage and a recording, in a folder of their own."""

    name: str
    folder: Path
    what: str
    """Family, and what was done to both."""


@dataclass(frozen=True)
class Outcome:
    """How the diagnosis of a pair ended."""

    pair: Pair
    status: int
    seconds: float
    verdict: str
    """Empty where there was no answer."""
    said: str

    @property
    def fault(self) -> str:
        """Say what is wrong with it; empty where nothing is."""
        if self.status == 0:
            return "" if self.verdict else "no answer"
        lines = [line for line in self.said.splitlines() if line.strip()]
        if self.status == 2 and len(lines) == 1:
            return ""
        return f"status {self.status}, {len(lines)} lines"


def drawn(count: int, seed: int, folder: Path) -> list[Pair]:
    """Draw pairs, and write each into a folder of its own."""
    families = list(FAMILIES)
    plans = plan(len(families), seed, families=families)
    cases = []
    for one in plans:
        case = draw(one)
        run = case.run("train")
        named = {"time": run.time, "position": run.position, "voltage": run.voltage}
        columns = {k: np.asarray(v, dtype=float) for k, v in named.items()}
        if not case.loop.open:
            columns["reference"] = np.asarray(run.reference, dtype=float)
        cases.append((one.family, case.believed, columns))
    pairs = []
    for i in range(count):
        chance = np.random.default_rng([seed, i])
        family, believed, columns = cases[i % len(cases)]
        stage, done = copy.deepcopy(believed), []
        for part, ways in ((stage, STAGES), (columns, RECORDINGS)):
            share = chance.random()
            times = int(share < ONCE) + int(share < TWICE)
            for way in chance.choice(len(ways), size=times, replace=False):
                done.append(ways[way].__name__)
                if part is stage:
                    STAGES[way](stage, chance)
                else:
                    columns = RECORDINGS[way](columns, chance)
        where = folder / f"{i:04d}"
        where.mkdir()
        (where / "stage.yaml").write_text(yaml.safe_dump(stage), encoding="utf-8")
        head, table = ",".join(columns), np.column_stack(list(columns.values()))
        np.savetxt(where / "run.csv", table, fmt="%.12g", delimiter=",", header=head, comments="")
        pairs.append(Pair(where.name, where, f"{family}: {', '.join(done) or 'as it is'}"))
    return pairs


def diagnosed(pair: Pair, budget: float) -> Outcome:
    """Diagnose a pair with the installed command."""
    command = [
        str(Path(sys.executable).parent / "rtcomp"), "diagnose", "run.csv", "--stage", "stage.yaml", "--json",
        "--budget", f"{budget:g}", "--out", "out",
    ]  # fmt: skip
    began = time.perf_counter()
    try:
        run = subprocess.run(
            command, cwd=pair.folder, capture_output=True, text=True, timeout=PATIENCE * budget, check=False
        )
    except subprocess.TimeoutExpired:
        return Outcome(pair, -1, time.perf_counter() - began, "", f"did not end within {PATIENCE:g} budgets")
    seconds = time.perf_counter() - began
    try:
        verdict = str(json.loads(run.stdout)["verdict"]) if run.returncode == 0 else ""
    except (ValueError, KeyError):
        verdict = ""
    return Outcome(pair, run.returncode, seconds, verdict, run.stderr)


@click.command()
@click.option("--pairs", "count", type=click.IntRange(1), default=60, show_default=True)
@click.option("--seed", default=1, show_default=True)
@click.option("--budget", default=10.0, show_default=True, help="Of each diagnosis, in s.")
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="At the same time.")
@click.option("--keep", type=click.Path(path_type=Path), help="New folder that keeps pairs and answers.")
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(count: int, seed: int, budget: float, jobs: int, keep: Path | None, path: Path | None) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        folder = keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=keep is None)
        pairs = drawn(count, seed, folder)
        with ThreadPoolExecutor(jobs) as pool:
            ended = list(pool.map(lambda pair: diagnosed(pair, budget), pairs))
    refused = sorted(o.seconds for o in ended if o.status == 2)
    start = refused[0] if refused else 0.0
    answers = [o for o in ended if o.verdict]
    late = [o for o in answers if o.seconds - start > 1.1 * budget]
    longest = max((o.seconds for o in answers), default=start) - start
    for one in ended:
        if one.fault or one in late:
            wrong = one.fault or f"{one.seconds:.1f} s"
            click.echo(f"{one.pair.name} {one.pair.what}: {wrong}\n{one.said[-500:]}")
    said = ", ".join(f"{n} {verdict}" for verdict, n in Counter(o.verdict for o in answers).most_common())
    figures = [
        Figure("pairs", float(len(ended)), "", "", f"seed {seed}"),
        Figure("answered", float(len(answers)), "", "", said),
        Figure("refused in one line", float(sum(o.status == 2 and not o.fault for o in ended))),
        Figure("neither", float(sum(bool(o.fault) for o in ended)), "", "<= 0"),
        Figure("beyond the budget by more than a tenth", float(len(late)), "", "<= 0", f"of {budget:g} s"),
        Figure("longest, start of the process apart", longest, "s"),
    ]
    show("One answer or one clear line", figures, path)


if __name__ == "__main__":
    main()
