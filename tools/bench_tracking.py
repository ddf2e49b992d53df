"""Compensation in virtual time: one controller with and without, through presliding and sliding.

On the simulated Leuven stage, and on one whose loops are neither symmetric nor congruent, as the paper's rig.

    python tools/bench_tracking.py --json tracking.json
"""

from __future__ import annotations

from pathlib import Path

import click
from figures_table import Figure, show

from rtcomp.jobs.compensate import Compensated, compensate
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import identify
from rtcomp.jobs.paper.rig import ASYMMETRY, SOFTENING
from rtcomp.stage.stage import Stage


def compensated(config: Configuration) -> Compensated:
    return compensate(config, identify(config).model)


def failing(stage: Stage) -> Stage:
    """Return the stage with loops that are neither symmetric nor congruent."""
    data = stage.to_dict()
    data["stage"]["effects"] = [
        {"name": "asymmetric-friction", "asymmetry": ASYMMETRY},
        {"name": "non-congruent-friction", "softening": SOFTENING},
    ]
    return Stage.from_dict(data)


def figures_of(name: str, done: Compensated, target: str = "", peak: str = "") -> list[Figure]:
    return [
        Figure(f"{name}: tracking error smaller by", done.improvement, "times", target),
        Figure(f"{name}: rms without", 1e6 * done.error_without.rms, "um"),
        Figure(f"{name}: rms with", 1e6 * done.error_with.rms, "um"),
        Figure(f"{name}: peak without", 1e6 * done.error_without.peak, "um"),
        Figure(f"{name}: peak with", 1e6 * done.error_with.peak, "um", peak, "the paper's rig: 5 um"),
    ]


@click.command()
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(path: Path | None) -> None:
    figures = []
    plain = Configuration.load(shipped("leuven.yaml"))
    for delay, target in ((0, 50), (1, 30)):
        config = plain.changed(device={"driver": "simulated", "delay_ticks": delay})
        name = "one tick of delay" if delay else "ideal"
        figures += figures_of(name, compensated(config), f">= {target}")
    for model, peak in (("interval", ""), ("self-placing", ""), ("auto", "<= 1")):
        section = {**plain.file.data["identify"], "model": model}
        config = plain.changed(identify=section).simulating(failing(plain.stage))
        figures += figures_of(f"failing rig, {model}", compensated(config), peak=peak)
    show("Compensation, simulated Leuven stage with 15 nm noise at 1 kHz", figures, path)


if __name__ == "__main__":
    main()
