"""The paper's case: 20 equal intervals, cycles of 1000 samples, the simulated Leuven stage.

Learned in the loop's own tick; judged with frozen weights on other, noise-free motion, relative to the peak
force. Noise is added to the recorded position as in Fig. 9b: uniform, with an amplitude of 5 % of the range
(the sum of the intervals). The paper needed about 60 cycles to an error of 5 %.

    python tools/bench_paper.py --json paper.json
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np
from figures_table import Figure, show

from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.learner import learn
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.hysteresis.rls import Rls
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.follow import follow
from rtcomp.jobs.identify import friction, identify
from rtcomp.jobs.judge import Friction, judge
from rtcomp.jobs.session import Run
from rtcomp.kernels import Floats, compiled
from rtcomp.recording.reader import Recording

CYCLE = 1000
RANGE_M = 1e-4
CYCLES = 10
PLAIN: dict[str, Any] = {"intervals": 20, "range": RANGE_M, "learner": {"learner": "rls", "forgetting": 1.0}}
QUIET = {**PLAIN, "smoothing": 0.0}
NOISY = {**PLAIN, "smoothing": 10.0, "gate": 0.005 * RANGE_M, "prior": "non-increasing"}


def stage() -> Configuration:
    """The Leuven stage without sensor noise, moved in cycles that saturate the hysteresis."""
    cycles = {"kind": "sine", "amplitude": 7e-5, "frequency": 1.0, "duration": float(CYCLES), "fade": 0.1}
    base = Configuration.load(shipped("leuven.yaml"))
    return base.changed(sensor={"noise": 0.0, "resolution": 0.0}, reference=cycles, identify=QUIET)


def learned(
    config: Configuration, run: Run, cycles: int, noise_m: float, seed: int, **section: Any
) -> HysteresisModel:
    """Learn from the first `cycles` of a run through the loop's tick, noise added to the position."""
    rows = {k: run.columns[k][: cycles * CYCLE].copy() for k in ("time", "position", "voltage", "reference")}
    rows["position"] += noise_m * np.random.default_rng(seed).uniform(-1, 1, cycles * CYCLE)
    return identify(config.changed(identify=section), Recording(rows, float(CYCLE))).model


@compiled
def plain_lms(x: Floats, force: Floats, w: Floats, mu: float, bias: float) -> None:
    """The paper's rule (8) sample by sample on the activations as they are, with a bias weight."""
    for k in range(x.shape[0]):
        error = force[k] - w[-1] * bias
        for i in range(x.shape[1]):
            error -= w[i] * x[k, i]
        for i in range(x.shape[1]):
            w[i] += mu * error * x[k, i]
        w[-1] += mu * error * bias


def cycles_of_lms(own: Friction, other: Friction, step: float, most: int) -> float:
    """Return the cycles that (8) needs until its frozen weights stay below 5 % on the other motion."""
    basis = IntervalBasis.over(20, RANGE_M)
    x = regressors(basis, own.position) + basis.widths / 2
    bias = float(basis.widths.mean())
    power = float(np.mean(np.sum(x**2, axis=1)) + bias**2)
    w = np.zeros(21)
    for cycle in range(1, most + 1):
        part = slice((cycle - 1) % CYCLES * CYCLE, ((cycle - 1) % CYCLES + 1) * CYCLE)
        plain_lms(x[part], own.force[part], w, step / power, bias)
        offset = float(w[-1] * bias + w[:-1] @ basis.widths / 2)
        if judge(HysteresisModel(basis, w[:-1], offset), other, settle=0.5).relative <= 0.05:
            return float(cycle)
    return float("inf")


def raw_error(own: Friction, other: Friction, noise_m: float, seed: int) -> float:
    """Return the error (%) of plain RLS on the noisy position and the clean force, as they come."""
    rows = CYCLES * CYCLE
    noisy = own.position[:rows] + noise_m * np.random.default_rng(seed).uniform(-1, 1, rows)
    basis = IntervalBasis.over(20, RANGE_M)
    weights = learn(basis, Rls(forgetting=1.0), noisy, own.force[:rows])
    return 100 * judge(HysteresisModel(basis, weights), other, settle=0.5).relative


@click.command()
@click.option("--seeds", default=10, show_default=True)
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(seeds: int, path: Path | None) -> None:
    config = stage()
    run = follow(config, "")
    own, other = friction(config, run), friction(config, follow(config, "judge"))

    def error(cycles: int, noise: float, seed: int, **section: Any) -> float:
        return 100 * judge(learned(config, run, cycles, noise, seed, **section), other, settle=0.5).relative

    noise = 0.05 * RANGE_M
    clean = error(1, 0.0, 0, **QUIET)
    two = [error(2, noise, s, **NOISY) for s in range(seeds)]
    ten = [error(10, noise, s, **NOISY) for s in range(seeds)]
    raw = [raw_error(own, other, noise, s) for s in range(seeds)]
    lms = {step: cycles_of_lms(own, other, step, 2000) for step in (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)}
    best = min(lms, key=lambda s: lms[s])
    figures = [
        Figure("held-out error, no noise, one cycle", clean, "%", "<= 1"),
        Figure("with noise, two cycles, median", float(np.median(two)), "%", "<= 3"),
        Figure("with noise, two cycles, worst", max(two), "%", "<= 3", f"of {seeds} draws of the noise"),
        Figure("with noise, ten cycles, median", float(np.median(ten)), "%", "<= 2"),
        Figure("with noise, ten cycles, worst", max(ten), "%", "<= 2", f"of {seeds} draws of the noise"),
        Figure(
            "raw RLS with noise, ten cycles, median",
            float(np.median(raw)),
            "%",
            "",
            "no smoothing, gate, prior",
        ),
        Figure(
            "plain LMS (8) without noise, cycles to 5 %", lms[best], "", "", f"best of six steps ({best:g})"
        ),
        Figure(
            "... with a tenth of that step", lms.get(best / 10, float("nan")), "", "", "the paper: about 60"
        ),
    ]
    show("The paper's case", figures, path, two=two, ten=ten, lms={str(k): v for k, v in lms.items()})


if __name__ == "__main__":
    main()
