"""Friction that changes while it is learned, and an hour that tries to spoil what was learned.

The Leuven stage in virtual time, identified and compensated in one run. First its friction rises or falls by
30 % within 10 s; the weights of each moment are frozen and judged on other motion with friction as it is in
the end. Then an hour of strokes of all sizes, slow ways far into saturation, and rests, with sensor noise.

    python tools/bench_drift.py --minutes 60 --json drift.json
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import click
import numpy as np
from figures_table import Figure, show

from rtcomp.cli.runs import load
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.follow import follow
from rtcomp.jobs.identify import ALWAYS, friction, identify
from rtcomp.jobs.judge import learning_curve
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

CHANGE, WITHIN_S, AFTER_S = 0.3, 10.0, 1.0
LEARNERS: dict[str, dict[str, Any]] = {
    "rls, drift 3e-5": {"learner": "rls", "forgetting": 0.9995, "drift": 3e-5},
    "rls": {"learner": "rls", "forgetting": 0.9995},
    "nlms": {"learner": "nlms", "step": 0.05},
}
MINUTE_S, REST_S = 60, 15
STEP_S = 0.05
STILL_M = 1.2e-7
"""Eight times the sensor's rms noise: what a hundred samples at rest span."""


def drifting(stage: Stage, change: float) -> Stage:
    """Return the stage with friction that changes by `change`, all but 1 % of that within `WITHIN_S`."""
    data = stage.to_dict()
    effect = {"name": "friction-drift", "change": change, "time_constant": WITHIN_S / np.log(100.0)}
    data["stage"]["effects"] = [*data["stage"].get("effects", []), effect]
    return Stage.from_dict(data)


def changed(stage: Stage, change: float) -> Stage:
    """Return the stage with friction as it is in the end."""
    data = stage.to_dict()
    for element in data["stage"]["friction"]:
        element["stiffness"] *= 1.0 + change
    return Stage.from_dict(data)


def errors(config: Configuration, change: float) -> tuple[float, float]:
    """Return the held-out error after `WITHIN_S`, and `AFTER_S` later, of weights learned until then."""
    model = identify(config).model
    reference = {**config.file.data["reference"], "duration": WITHIN_S + AFTER_S + 0.5}
    moving = config.changed(reference=reference)
    plant = drifting(config.stage, change)
    run = follow(moving.simulating(plant), "", learn=ALWAYS, model=model, feedforward_from=0.0)
    end = config.simulating(changed(config.stage, change))
    judged = friction(end, follow(end, "judge"))
    curve = learning_curve(run.tick.settled_basis, run.weights, run.tick.offset_scale, judged, settle=0.5)
    before, after = (int(np.searchsorted(run.weights_time, t)) for t in (WITHIN_S, WITHIN_S + AFTER_S))
    return float(curve[before]), float(curve[after])


def pattern(minutes: int, seed: int = 0) -> tuple[Floats, Floats]:
    """Return times (s) and places (m): each minute strokes, a long slow way, tiny strokes, and a rest."""
    draw, places = np.random.default_rng(seed), [np.zeros(round(1.0 / STEP_S))]
    for _ in range(minutes):
        time = np.arange(0.0, 25.0, STEP_S)
        swell = np.abs(np.sin(2 * np.pi * draw.uniform(0.02, 0.1) * time))
        size = draw.uniform(5e-6, 8e-5) * (0.1 + 0.9 * swell)
        strokes = size * np.sin(2 * np.pi * draw.uniform(0.5, 1.5) * time) * np.minimum(1.0, time)
        far = draw.choice([-1.0, 1.0]) * 4e-4 * np.sin(np.pi * np.arange(0.0, 10.0, STEP_S) / 10.0) ** 2
        tiny = draw.uniform(5e-8, 2e-6) * np.sin(2 * np.pi * np.arange(0.0, 10.0, STEP_S))
        fade = np.minimum(1.0, np.arange(strokes.size)[::-1] * STEP_S)
        rest = np.zeros(round((MINUTE_S - 45.0) / STEP_S))
        places += [strokes * fade, far, tiny, rest]
    place = np.concatenate(places)
    return np.arange(place.size) * STEP_S, place


def hour(config: Configuration, minutes: int) -> list[Figure]:
    """Return what the long run did to the weights."""
    with tempfile.TemporaryDirectory(prefix="rtcomp-bench-") as folder:
        path = Path(folder, "reference.csv")
        np.savetxt(
            path, np.column_stack(pattern(minutes)), delimiter=",", header="time,reference", comments=""
        )
        moving = config.changed(reference={"kind": "file", "path": str(path)})
        run = follow(moving, "", learn=ALWAYS, feedforward_from=0.0, path=Path(folder, "run.h5"))
    time, weights = run.weights_time, run.weights
    judged = friction(config, follow(config, "judge"))
    each = max(1, len(time) // 240)
    curve = learning_curve(run.tick.settled_basis, weights[::each], run.tick.offset_scale, judged, settle=0.5)
    settled = time[::each] > 2 * MINUTE_S
    rest = (time - 1.0) % MINUTE_S > MINUTE_S - REST_S + 1.0
    # At rest is what does not move by more than the sensor's noise: the integral may still creep.
    block = round((time[1] - time[0]) * config.stage.rate)
    position = run.columns["position"][: (len(time) - 1) * block].reshape(-1, block)
    still = np.ptp(position, axis=1) < STILL_M
    still[1:] &= np.abs(np.diff(position.mean(axis=1))) < 0.1 * STILL_M
    still[2:] &= still[1:-1] & still[:-2]
    pairs = rest[1:] & rest[:-1] & (time[1:] > MINUTE_S) & still
    most = np.abs(weights[:, : config.identify.intervals]).max()
    moved = float(np.abs(np.diff(weights, axis=0))[pairs].max() / most)
    return [
        Figure("held-out error after two minutes, worst", 100 * float(curve[settled].max()), "%"),
        Figure("... above 2 %", 100 * float(np.mean(curve[settled] > 0.02)), "% of the time"),
        Figure("held-out error at the end", 100 * float(curve[-1]), "%", "<= 2"),
        Figure("weights changed at rest, most, of the largest", moved, "", "<= 1e-9"),
        Figure("identifier put aside", float(run.outcome.diverged), "times", "<= 0"),
        Figure("learning taken back", float(run.outcome.taken_back), "times", "<= 0"),
        Figure("moments at rest", float(np.count_nonzero(pairs)), "", ">= 1"),
        Figure("ticks", float(run.outcome.ticks), "", "", f"{time[-1] / 60:.3g} minutes of virtual time"),
    ]


@click.command()
@click.option("--minutes", default=60, show_default=True, help="Of the long run.")
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(minutes: int, path: Path | None) -> None:
    config = load(shipped("leuven.yaml"))
    section, figures = config.file.data["identify"], []
    for name, learner in LEARNERS.items():
        for change in (CHANGE, -CHANGE):
            there, then = errors(config.changed(identify={**section, "learner": learner}), change)
            most = "<= 2" if "drift" in name else ""
            note = f"{100 * there:.2g} % as the change ends"
            head = f"{name}: friction {100 * change:+.0f} % in {WITHIN_S:g} s, held-out {AFTER_S:g} s later"
            figures.append(Figure(head, 100 * then, "%", most, note))
    for model in ("interval", "self-placing"):
        learner = LEARNERS["rls, drift 3e-5"]
        found = hour(config.changed(identify={**section, "model": model, "learner": learner}), minutes)
        figures += [Figure(f"{model}: {f.name}", f.value, f.unit, f.target, f.note) for f in found]
    show(f"Friction that changes, and {minutes} minutes of everything", figures, path)


if __name__ == "__main__":
    main()
