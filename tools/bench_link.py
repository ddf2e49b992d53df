"""Identify and compensate at 1 kHz in real time over a serial link, the stage in another process.

python tools/bench_link.py --json link.json
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import click
import numpy as np
from figures_table import Figure, show
from rtcomp_drivers.plant_process import PlantProcess

from rtcomp.cli.runs import lasting, load
from rtcomp.jobs.compensate import compensate
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import identify
from rtcomp.recording.reader import load as load_table


@click.command()
@click.option("--seconds", default=20.0, show_default=True)
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(seconds: float, path: Path | None) -> None:
    file = shipped("leuven.yaml")
    with tempfile.TemporaryDirectory() as folder, PlantProcess(file) as plant:
        out = Path(folder)
        config = lasting(load(file, port=plant.port), seconds)
        done = compensate(config, identify(config, out=out).model, out=out)
        rows = [load_table(out / f"{name}.h5").columns for name in ("recording", "judge", "without", "with")]
        ticks = round(seconds * config.stage.rate)
        kept = [bool(np.array_equal(np.round(r["time"] * config.stage.rate), np.arange(ticks))) for r in rows]
        both = (done.without, done.with_it)
        stale = sum(int(np.count_nonzero(r.columns["status"])) for r in both)
        round_trip = np.concatenate([r.columns["execution_us"][1:] for r in both])
    lateness = np.concatenate([r.columns["lateness_us"] for r in both])
    figures = [
        Figure("tracking error smaller by", done.improvement, "times", ">= 20"),
        Figure("rms without", 1e6 * done.error_without.rms, "um"),
        Figure("rms with", 1e6 * done.error_with.rms, "um"),
        Figure("peak with", 1e6 * done.error_with.peak, "um", "", "the paper's rig: 5 um"),
        Figure("runs with every tick in the recording", float(sum(kept)), "of 4", ">= 4"),
        Figure("slots lost", float(sum(r.outcome.lost for r in both)), f"of {2 * ticks}"),
        Figure("samples missing", float(stale), f"of {2 * ticks}"),
        Figure("lateness, median", float(np.median(lateness)), "us"),
        Figure("lateness, 99 %", float(np.percentile(lateness, 99)), "us"),
        Figure("tick with round trip, median", float(np.median(round_trip)), "us"),
        Figure("tick with round trip, 99 %", float(np.percentile(round_trip, 99)), "us"),
    ]
    show(
        f"Serial link, {seconds:g} s a run at {config.stage.rate:g} Hz, wall clock",
        figures,
        path,
        **both[1].realtime,
    )


if __name__ == "__main__":
    main()
