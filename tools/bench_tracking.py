"""Compensation in virtual time: one controller with and without, through presliding and sliding.

python tools/bench_tracking.py --json tracking.json
"""

from __future__ import annotations

from pathlib import Path

import click
from figures_table import Figure, show

from rtcomp.jobs.compensate import compensate
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import identify


@click.command()
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(path: Path | None) -> None:
    figures = []
    for delay, target in ((0, 50), (1, 30)):
        config = Configuration.load(shipped("leuven.yaml"))
        config = config.changed(device={"driver": "simulated", "delay_ticks": delay})
        done = compensate(config, identify(config).model)
        name = "one tick of delay" if delay else "ideal"
        figures += [
            Figure(f"{name}: tracking error smaller by", done.improvement, "times", f">= {target}"),
            Figure(f"{name}: rms without", 1e6 * done.error_without.rms, "um"),
            Figure(f"{name}: rms with", 1e6 * done.error_with.rms, "um"),
            Figure(f"{name}: peak without", 1e6 * done.error_without.peak, "um"),
            Figure(f"{name}: peak with", 1e6 * done.error_with.peak, "um", "", "the paper's rig: 5 um"),
        ]
    show("Compensation, simulated Leuven stage with 15 nm noise at 1 kHz", figures, path)


if __name__ == "__main__":
    main()
