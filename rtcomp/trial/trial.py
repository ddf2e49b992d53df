"""A trial from end to end: draw, seal, let others diagnose, open, score."""

from __future__ import annotations

import csv
import functools
import itertools
import json
import math
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rtcomp import __version__
from rtcomp.errors import RtcompError
from rtcomp.interrupts import Stop, signals_wait
from rtcomp.trial.calibration import calibration
from rtcomp.trial.draw import Case, Plan, draw, plan
from rtcomp.trial.figures import Figure, Seen, figures, seen
from rtcomp.trial.rival import RIVALS, missing
from rtcomp.trial.run import Outcome, Processes, Task
from rtcomp.trial.says import Said
from rtcomp.trial.score import Errors, Scored, score
from rtcomp.trial.seal import Sealed
from rtcomp.trial.stagefile import exact_stage, write_case, write_recording
from rtcomp.trial.stopped import Stopped
from rtcomp.yamlfile import dump_yaml

EDGE_ROWS = 100
"""Rows left out of the relative force error at either end: filters settle."""
REPLAY_S = 300.0
DIAGNOSES = "diagnoses"
"""Step and folder of the program that is tried; every rival has one by its own name."""


@dataclass(frozen=True)
class Settings:
    """What a trial is to be; recording, stage and output are added to `diagnose` and `replay`."""

    cases: int
    seed: int
    jobs: int
    diagnose: tuple[str, ...]
    replay: tuple[str, ...]
    timeout_s: float = 900.0
    rivals: tuple[str, ...] = tuple(RIVALS)
    only: str | None = None
    """The kind that all cases are of; None for all kinds."""
    families: tuple[str, ...] = ("micrometre",)
    forms: float | None = None
    """Share of effects hidden in another form, of those that have one; None for that of each family."""


Progress = Callable[[str, int, int], None]
"""Called with the step's name, how many of it are done, and of how many."""


@dataclass(frozen=True)
class Trial:
    """What came out."""

    rows: list[Scored]
    figures: list[Figure]
    seen: list[Seen]
    rivals: dict[str, list[Figure]]
    notes: list[str]
    seconds: float
    not_drawn: dict[str, str] = field(default_factory=dict)
    """Why cases could not be drawn, by case."""

    @property
    def families(self) -> dict[str, list[Scored]]:
        """The rows of each family."""
        names = dict.fromkeys(row.case.plan.family for row in self.rows)
        return {name: [r for r in self.rows if r.case.plan.family == name] for name in names}

    def to_json(self, settings: Settings) -> dict[str, Any]:
        """Return the content of ``trial.json``."""
        return {
            "version": __version__,
            "cases": settings.cases,
            "seed": settings.seed,
            "only": settings.only,
            "forms": settings.forms,
            "seconds": self.seconds,
            "figures": [f.to_json() for f in self.figures],
            "smallest_seen": [
                {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in asdict(s).items()}
                for s in self.seen
            ],
            "rivals": {name: [f.to_json() for f in found] for name, found in self.rivals.items()},
            "families": {
                name: {
                    "cases": len(rows),
                    "figures": [f.to_json() for f in figures(rows)],
                    "calibration": [s.to_json() for s in calibration(rows)],
                }
                for name, rows in self.families.items()
            },
            "calibration": [s.to_json() for s in calibration(self.rows)],
            "not_drawn": self.not_drawn,
            "notes": self.notes,
            "estimates": [
                {"case": row.case.plan.name, **asdict(e)} for row in self.rows for e in row.estimates
            ],
            "rows": [row.row() for row in self.rows],
        }


def trial(
    settings: Settings, out: Path, progress: Progress, keep: bool = False, earlier: Path | None = None
) -> Trial:
    """Run a trial into the folder `out`; raise SealError where an answer is not what was sealed.

    The unseen recordings are made only after the last diagnosis has ended; with `keep` they, the
    recordings and the diagnoses stay. A trial that is stopped leaves what another, given its folder as
    `earlier`, goes on from: what was diagnosed is not diagnosed again.
    """
    started = time.perf_counter()
    so_far = Stopped.read(earlier) if earlier else _nothing_yet(settings)
    before = so_far.seconds
    with signals_wait() as stop:
        try:
            sealed = _sealed(settings, out, progress, so_far, earlier, stop)
            with Processes(settings.jobs, stop) as processes:
                done = _through(settings, processes, out, progress, sealed, so_far, stop)
        except BaseException:
            # No diagnosis runs any more: only now may salts lie on a disk.
            so_far.seconds = before + time.perf_counter() - started
            so_far.write(out)
            raise
    if earlier is not None:
        done.notes.insert(0, f"gone on with after it was stopped at {before:.0f} s")
    done = replace(done, seconds=before + time.perf_counter() - started)
    _write(out, settings, done)
    if not keep:
        for folder in ("cases", *so_far.ended):
            shutil.rmtree(out / folder)
    return done


def _nothing_yet(settings: Settings) -> Stopped:
    return Stopped(
        settings.cases, settings.seed, only=settings.only, families=list(settings.families),
        forms=settings.forms,
    )  # fmt: skip


def _sealed(
    settings: Settings, out: Path, progress: Progress, so_far: Stopped, earlier: Path | None, stop: Stop
) -> Sealed:
    """Draw all cases, write what the diagnoses get, and commit to the answers (or check them, if gone on)."""
    if earlier is not None:  # first of all: who stops it again finds here what was found there
        so_far.bring(earlier, out)
    plans = plan(settings.cases, settings.seed, settings.only, settings.families, settings.forms)
    answers, so_far.not_drawn = {}, {}
    pool = ThreadPoolExecutor(settings.jobs)
    try:
        for chosen, made in zip(plans, pool.map(_make, plans, [out] * len(plans)), strict=True):
            if isinstance(made, Case):
                answers[chosen.name] = made.answer()
            else:
                so_far.not_drawn[chosen.name] = made
            progress("draw", len(answers) + len(so_far.not_drawn), len(plans))
            stop.hand_on()
    finally:
        pool.shutdown(cancel_futures=True)  # who stops it waits for the cases at hand, not for all
    if not answers:
        raise RtcompError(f"no case could be drawn; the first: {next(iter(so_far.not_drawn.values()))}")
    sealed = Sealed(answers, so_far.salts)
    if earlier is not None:
        sealed.check(out / "commitments.json")
    else:
        sealed.publish(out / "commitments.json")
        so_far.salts = sealed.salts
    return sealed


def _through(
    settings: Settings,
    processes: Processes,
    out: Path,
    progress: Progress,
    sealed: Sealed,
    so_far: Stopped,
    stop: Stop,
) -> Trial:
    """Diagnose what is left, open the answers and score."""
    names = list(sealed.salts)
    chosen = [r for r in settings.rivals if not missing(r)]
    notes = [f"rival {r}: {RIVALS[r]} is not installed (extras group rivals)" for r in settings.rivals
             if r not in chosen]  # fmt: skip
    steps: dict[str, Callable[[Settings, Path, str], Task]] = {
        DIAGNOSES: _diagnosis,
        **{r: functools.partial(_rival, r) for r in chosen},
    }
    ended = so_far.ended
    for step, task in steps.items():
        ended.setdefault(step, {})
        left = [name for name in names if name not in ended[step]]
        shown = _count(progress, step, len(names), len(names) - len(left))

        def each(outcome: Outcome, step: str = step, shown: Callable[[Outcome], None] = shown) -> None:
            ended[step][outcome.name] = outcome
            shown(outcome)

        processes.run([task(settings, out, name) for name in left], each)
    if processes.running:
        raise RuntimeError("a diagnosis still runs; the seal stays closed")
    answers = sealed.open(out / "answers.json", out / "commitments.json")
    cases = [Case.again(answers[name]) for name in names]
    errors = _judge(settings, processes, out, cases, ended[DIAGNOSES], progress, stop)
    rows = _scored(cases, ended[DIAGNOSES], out / DIAGNOSES, errors)
    rivals = {r: figures(_scored(cases, ended[r], out / r, {}), gains=False) for r in chosen}
    notes += [f"{r.case.plan.name}: {r.fault}" for r in rows if r.fault]
    notes += [f"{name}: not drawn: {why}" for name, why in so_far.not_drawn.items()]
    return Trial(rows, figures(rows), seen(rows), rivals, notes, 0.0, so_far.not_drawn)


def _scored(
    cases: Iterable[Case], ended: Mapping[str, Outcome], folder: Path, errors: Mapping[str, Errors]
) -> list[Scored]:
    rows = []
    for case in cases:
        name = case.plan.name
        rows.append(score(case, ended[name], *_read(folder / name, ended[name]), errors.get(name)))
    return rows


def _make(chosen: Plan, out: Path) -> Case | str:
    """Draw a case and write what the diagnosis gets; return why where that fails, which costs this case."""
    folder = out / "cases" / chosen.name
    try:
        case = draw(chosen)
        write_case(folder, case.believed, case.run("train"), case.loop)
    except Exception as error:
        shutil.rmtree(folder, ignore_errors=True)
        return f"{type(error).__name__}: {error}"
    return case


def _diagnosis(settings: Settings, out: Path, name: str) -> Task:
    case, into = out / "cases" / name, out / DIAGNOSES / name
    command = [*settings.diagnose, str(case / "train.csv.gz"), "--stage", str(case / "stage.yaml")]
    log = out / DIAGNOSES / f"{name}.log"
    return Task(name, (*command, "--out", str(into)), log, settings.timeout_s)


def _rival(rival: str, settings: Settings, out: Path, name: str) -> Task:
    result = out / rival / name / "diagnosis.json"
    module = [sys.executable, "-m", "rtcomp.trial.rival", rival]
    command = (*module, str(out / "cases" / name), str(result))
    return Task(name, command, out / rival / f"{name}.log", settings.timeout_s)


def _count(progress: Progress, step: str, of: int, done: int = 0) -> Callable[[Outcome], None]:
    counter = itertools.count(done + 1)

    def each(outcome: Outcome) -> None:
        progress(step, next(counter), of)

    return each


def _read(folder: Path, outcome: Outcome) -> tuple[Said | None, str]:
    """Return what was said and "", or None and what went wrong."""
    if outcome.timed_out:
        return None, f"diagnosis ended after {outcome.seconds:.0f} s without an answer"
    if outcome.status != 0:
        return None, f"diagnosis ended with status {outcome.status}: {outcome.words or 'no word'}"
    try:
        return Said.read(folder / "diagnosis.json"), ""
    except ValueError as error:
        return None, str(error)


def _judge(
    settings: Settings,
    processes: Processes,
    out: Path,
    cases: Iterable[Case],
    said: Mapping[str, Outcome],
    progress: Progress,
    stop: Stop,
) -> dict[str, Errors]:
    """Make the unseen recordings and replay believed, diagnosed and exact stages on them."""
    tasks: dict[str, Task] = {}
    judged = [case for case in cases if said[case.plan.name].well]
    for n, case in enumerate(judged):
        name = case.plan.name
        folder, into = out / "cases" / name, out / DIAGNOSES / name
        write_recording(folder / "unseen.csv.gz", case.run("unseen"), case.loop)
        write_recording(folder / "bare.csv.gz", case.run("unseen", bare=True), case.loop)
        dump_yaml(folder / "exact.yaml", exact_stage(case.bare, case.loop, case.believed))
        for which, recording, stage in (
            ("before", "unseen", folder / "stage.yaml"),
            ("after", "unseen", into / "stage.yaml"),
            ("oracle", "bare", folder / "exact.yaml"),
        ):
            key, result = f"{name}/{which}", into / f"{which}.csv"
            command = [*settings.replay, str(folder / f"{recording}.csv.gz"), "--stage", str(stage)]
            tasks[key] = Task(key, (*command, "--out", str(result)), into / f"{which}.log", REPLAY_S)
        progress("unseen", n + 1, len(judged))
        stop.hand_on()
    ended = processes.run(list(tasks.values()), _count(progress, "replay", len(tasks)))
    well = {o.name for o in ended if o.well}
    errors = {}
    for case in judged:
        keys = [f"{case.plan.name}/{which}" for which in ("before", "after", "oracle")]
        if all(key in well for key in keys):
            errors[case.plan.name] = Errors(*(_relative(Path(tasks[key].command[-1])) for key in keys))
    return errors


def _relative(path: Path) -> float:
    """Return the relative force error of a replay: rms of the difference over rms of the motion side."""
    with path.open(encoding="utf-8") as file:
        head = next(csv.reader(file))
    columns = (head.index("force_drive"), head.index("force_motion"))
    table = np.loadtxt(path, delimiter=",", skiprows=1, usecols=columns)[EDGE_ROWS:-EDGE_ROWS]
    return float(np.sqrt(np.mean((table[:, 0] - table[:, 1]) ** 2) / np.mean(table[:, 1] ** 2)))


def _write(out: Path, settings: Settings, done: Trial) -> None:
    text = json.dumps(done.to_json(settings), indent=1, allow_nan=False)
    (out / "trial.json").write_text(text + "\n", encoding="utf-8")
    with (out / "rows.csv").open("w", encoding="utf-8", newline="") as file:
        rows = [row.row() for row in done.rows]
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
