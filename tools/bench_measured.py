"""The measured gear joint: learned on amplitudes up to 0.25 N m, judged frozen on 0.30 N m.

python tools/bench_measured.py yaw_sine_to_330s.csv.gz --json measured.json
"""

from __future__ import annotations

from pathlib import Path

import click
from figures_table import Figure, show

from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.identify import identify
from rtcomp.recording.reader import read

ALL = [0.0, 312.4]


@click.command()
@click.argument("recording", required=False, type=click.Path(path_type=Path))
@click.option("--json", "path", type=click.Path(path_type=Path))
def main(recording: Path | None, path: Path | None) -> None:
    if recording is None:
        click.echo("skipped: name the recording (see configs/heads_yaw.yaml)")
        return
    config = Configuration.load(shipped("heads_yaw.yaml"))
    section = config.run.recording
    data = read(recording, section.map)
    part = identify(config, data)
    further = identify(config.changed(identify={**config.file.data["identify"], "beyond": "continue"}), data)
    whole = identify(config.changed(identify={**config.file.data["identify"], "learn": ALL}), data)
    measured = read(recording, {**section.map, "voltage": "effort_measured_Nm"})
    effort = identify(config.changed(identify={**config.file.data["identify"], "learn": ALL}), measured)
    assert part.held_out is not None and further.held_out is not None
    figures = [
        Figure("learned to 0.25 N m, in sample", 1e3 * part.in_sample.rms, "mN m", "<= 24.5"),
        Figure("learned to 0.25 N m, judged on 0.30", 1e3 * part.held_out.rms, "mN m", "", "frozen weights"),
        Figure("... relative to the peak", 100 * part.held_out.relative, "%"),
        Figure(
            "... weights going on beyond the reach", 1e3 * further.held_out.rms, "mN m", "",
            "identify.beyond: continue",
        ),
        Figure(
            "learned to 0.30 N m, in sample", 1e3 * whole.in_sample.rms, "mN m", "<= 24.5",
            "a plain off-line Maxwell-slip fit: 24.5",
        ),
        Figure(
            "the same against measured effort", 1e3 * effort.in_sample.rms, "mN m", "",
            "whose noise alone is 24 mN m rms",
        ),
    ]  # fmt: skip
    show("Measured: yaw joint of a three-axis head", figures, path, notes=part.notes)


if __name__ == "__main__":
    main()
