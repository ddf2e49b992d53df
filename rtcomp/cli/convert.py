"""`rtcomp convert`: a recording into another format."""

from __future__ import annotations

from pathlib import Path

import click

from rtcomp.cli.options import force_option, json_option, map_option, rate_option
from rtcomp.cli.runs import to_json


@click.command()
@click.argument("source", type=click.Path(path_type=Path))
@click.argument("target", type=click.Path(path_type=Path))
@map_option
@rate_option
@force_option
@json_option
def convert(
    source: Path, target: Path, mapping: dict[str, str], rate: float | None, force: bool, as_json: bool
) -> None:
    """Turn the recording SOURCE into TARGET; their names say the formats.

    Reads CSV (.csv, .csv.gz), MATLAB (.mat) and HDF5 (.h5, .hdf5); writes these, Parquet (.parquet) and
    MCAP (.mcap). Rows that are not evenly spaced are resampled, outliers are marked in a column; what was
    done is said.

    \b
    Examples:
      rtcomp convert out/demo/recording.h5 recording.csv.gz
      rtcomp convert log.mat log.h5 --map position=qm --map voltage=vir --rate 1000
    """
    from rtcomp.recording.convert import convert as convert_recording

    recording = convert_recording(source, target, mapping, force=force, rate_hz=rate)
    if as_json:
        summary = {
            "target": str(target),
            "rows": len(recording),
            "rate_hz": recording.rate_hz,
            "columns": list(recording.columns),
            "notes": recording.notes,
        }
        click.echo(to_json(summary))
        return
    for note in recording.notes:
        click.echo(f"note: {note}")
    click.echo(f"{target}: {len(recording)} rows at {recording.rate_hz:g} Hz; {', '.join(recording.columns)}")
