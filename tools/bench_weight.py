"""Rotary axes whose belief lacks their weight: is gravity named, alone, and how near are its numbers?

    python tools/bench_weight.py --joints 8 --json weight.json

Geared joints are drawn as the trial draws them, each recorded twice: through its 12-bit encoder, and through
one of 18 bits. The error is that of the weight as a vector of amplitude and phase, over its amplitude.
"""

from __future__ import annotations

import cmath
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
from figures_table import Figure, show

from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.result import Diagnosis
from rtcomp.errors import RtcompError
from rtcomp.recording.reader import Recording
from rtcomp.stage.stage import Stage
from rtcomp.trial.axis import Loop
from rtcomp.trial.draw import Case, Plan, draw
from rtcomp.trial.plant import simulate

FAMILY = "geared-joint"
FINER = {"12-bit encoder": 1.0, "18-bit encoder": 64.0}
"""Times as many counts a turn as the family's own encoder has."""


def joints(count: int, seed: int) -> list[Case]:
    """Return drawn joints that carry a pendulum, none with anything hidden."""
    found: list[Case] = []
    while len(found) < count:
        drawn = draw(Plan(f"joint{seed}", "clean", (), "full", seed, FAMILY))
        found += [drawn] if drawn.physics.pendulum else []
        seed += 1
    return found


def recorded(case: Case, loop: Loop) -> Recording:
    """Return the case's run through the sensor of `loop`."""
    run = simulate(case.physics, loop, case.reference("train"), case.plan.seed)
    columns = {name: getattr(run, name) for name in ("time", "reference", "position", "voltage")}
    return Recording(columns, loop.rate, {}, Path(f"{case.plan.name}.csv"))


def without_weight(case: Case, loop: Loop) -> Stage:
    """Return the belief, read through the sensor of `loop`, without the weight."""
    content: dict[str, Any] = {**case.believed, "stage": dict(case.believed["stage"])}
    del content["stage"]["effects"]
    content["sensor"] = {"noise": loop.noise, "resolution": loop.resolution}
    return Stage.from_dict(content)


def off(found: Diagnosis, case: Case) -> float:
    """Return how far the weight that is told is off, over its amplitude; infinite where none is named."""
    told = next((e.parameters for e in found.effects if e.names[0] == "gravity"), None)
    if told is None:
        return float("inf")
    weight = cmath.rect(told["amplitude"].value, told["phase"].value)
    true = cmath.rect(case.physics.pendulum, case.physics.pendulum_phase)
    return abs(weight - true) / abs(true)


@click.command()
@click.option("--joints", "count", default=8, show_default=True, help="How many are drawn.")
@click.option("--seed", default=1, show_default=True)
@click.option("--budget", default=60.0, show_default=True, help="Seconds for each diagnosis.")
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(count: int, seed: int, budget: float, path: Path | None) -> None:
    figures, drawn = [], joints(count, seed)
    for encoder, finer in FINER.items():
        alone, errors, seconds, said = [], [], [], []
        for case in drawn:
            loop = case.loop._replace(resolution=case.loop.resolution / finer, noise=case.loop.noise / finer)
            began = time.perf_counter()
            try:
                found = diagnose(without_weight(case, loop), [recorded(case, loop)], budget=budget)
            except RtcompError as error:
                raise SystemExit(f"{case.plan.name}: {error}") from error
            seconds.append(time.perf_counter() - began)
            names = [e.names for e in found.effects]
            alone.append(names == [("gravity",)])
            errors.append(off(found, case))
            said.append(" + ".join(" or ".join(n) for n in names) or found.verdict)
            click.echo(f"{encoder}, {case.plan.name}: {said[-1]}, {100 * errors[-1]:.2g} % off", err=True)
        others = ", ".join(sorted({s for s, right in zip(said, alone, strict=True) if not right}))
        near = float(np.mean(np.array(errors) <= 0.03))
        figures += [
            Figure(f"{encoder}: gravity named, alone", float(np.mean(alone)), "", ">= 1", others),
            Figure(f"{encoder}: within 3 %", near, "", ">= 1"),
            Figure(f"{encoder}: error, median", 100.0 * float(np.median(errors)), "%"),
            Figure(f"{encoder}: time, median", float(np.median(seconds)), "s"),
        ]
    show("A weight that the belief lacks", figures, path, joints=count, seed=seed)


if __name__ == "__main__":
    main()
