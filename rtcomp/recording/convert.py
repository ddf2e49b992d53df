"""From any recording that can be read to CSV, CSV.gz, MAT 5, HDF5, Parquet and MCAP."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rtcomp.errors import OutputExistsError, RecordingError, RtcompError
from rtcomp.recording.events import write_events
from rtcomp.recording.reader import Recording, read
from rtcomp.recording.writer import replacing, write_csv
from rtcomp.units import COLUMN_UNITS, for_axis


def convert(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    column_map: Mapping[str, str] | None = None,
    force: bool = False,
    rate_hz: float | None = None,
) -> Recording:
    """Read `source` as `read` does (same `column_map`, `rate_hz`, errors), write it to `target`, return it.

    The suffix of `target` says the format: ``.csv``, ``.csv.gz``, ``.mat`` (MATLAB 5), ``.h5``/``.hdf5``,
    ``.parquet`` (extra ``parquet``), ``.mcap`` (extra ``mcap``). Metadata and the identifier's weights go
    along where the format has a place for them; what it has not is said in `notes`.

    Raises OutputExistsError where `target` exists and `force` is false or where it is the source itself,
    RecordingError where the suffix is none of these or the file cannot be written, RtcompError where the
    extra is not installed.
    """
    source, target = Path(source), Path(target)
    write = _writer(target)
    if target.exists() and source.exists() and target.samefile(source):
        raise OutputExistsError(f"{target}: is the recording itself; choose another name")
    if os.path.lexists(target) and not force:
        raise OutputExistsError(f"{target}: exists already; choose another name or use --force")
    recording = read(source, column_map, rate_hz=rate_hz)
    write(recording, target, force)
    if recording.weights is not None and write not in (_hdf5, _mat):
        recording.notes.append(
            f"the identifier's weights are not in {target.name}: only HDF5 and MAT hold them"
        )
    if recording.events and write is not _hdf5:
        recording.notes.append(f"the events of the run are not in {target.name}: only HDF5 holds them")
    if recording.metadata and write is _csv:
        recording.notes.append(f"metadata is not in {target.name}: CSV has no place for it")
    return recording


def _writer(target: Path) -> Callable[[Recording, Path, bool], None]:
    name = target.name.lower()
    for suffix, write in _WRITERS.items():
        if name.endswith(suffix):
            return write
    raise RecordingError(f"{target}: unknown kind of target; its name must end in {', '.join(_WRITERS)}")


def _csv(recording: Recording, target: Path, force: bool) -> None:
    names: dict[str, Any] = {}
    for name, column in recording.columns.items():
        names[re.sub(r'[,;\t\n\r"#]', "_", name)] = column
    write_csv(target, names, force)


def _mat(recording: Recording, target: Path, force: bool) -> None:
    from scipy.io import savemat

    content: dict[str, Any] = {_identifier(name): column for name, column in recording.columns.items()}
    content["metadata"] = {_identifier(k): _text_or_number(v) for k, v in recording.metadata.items()}
    if recording.weights is not None:
        content["weights"] = {"time": recording.weights_time, "weights": recording.weights}
    with replacing(target, force) as temporary:
        savemat(temporary, content, oned_as="column", long_field_names=True, do_compression=True)


def _hdf5(recording: Recording, target: Path, force: bool) -> None:
    import h5py

    with replacing(target, force) as temporary, h5py.File(temporary, "w-", libver=("v110", "v110")) as file:
        for name, column in recording.columns.items():
            dataset = file.create_dataset(
                name.replace("/", "_"), data=column, compression="gzip", shuffle=True
            )
            dataset.attrs["unit"] = _unit(recording, name)
        if recording.weights is not None:
            file["weights/time"] = recording.weights_time
            file["weights/weights"] = recording.weights
        if recording.events:
            write_events(file, recording.events)
        metadata = {"format": "rtcomp recording 1", "complete": 1, "rows_lost": 0} | recording.metadata
        for key, value in metadata.items():
            file.attrs[key] = _text_or_number(value)


def _parquet(recording: Recording, target: Path, force: bool) -> None:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise RtcompError("writing Parquet needs pyarrow: pip install 'rtcomp[parquet]'") from None
    fields = [
        pa.field(name, pa.float64(), metadata={"unit": _unit(recording, name)}) for name in recording.columns
    ]
    metadata = {key: str(_text_or_number(value)) for key, value in recording.metadata.items()}
    table = pa.table(list(recording.columns.values()), schema=pa.schema(fields, metadata=metadata))
    with replacing(target, force) as temporary:
        pq.write_table(table, temporary)


def _mcap(recording: Recording, target: Path, force: bool) -> None:
    """One JSON message a row on the topic ``/recording``, as PlotJuggler and Foxglove read them."""
    try:
        from mcap.writer import Writer
    except ImportError:
        raise RtcompError("writing MCAP needs mcap: pip install 'rtcomp[mcap]'") from None
    properties = {
        name: {"type": "number", "description": _unit(recording, name)} for name in recording.columns
    }
    schema = {"type": "object", "title": "rtcomp.Recording", "properties": properties}
    nanoseconds = np.round((recording.time - min(0.0, recording.time[0])) * 1e9).astype(np.int64).tolist()
    names = list(recording.columns)
    rows = zip(*(column.tolist() for column in recording.columns.values()), strict=True)
    with replacing(target, force) as temporary, temporary.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="rtcomp")
        schema_id = writer.register_schema("rtcomp.Recording", "jsonschema", json.dumps(schema).encode())
        channel = writer.register_channel("/recording", "json", schema_id)
        for at, row in zip(nanoseconds, rows, strict=True):
            # JSON has no NaN: a value that is not finite is left out of its message.
            data = {name: value for name, value in zip(names, row, strict=True) if abs(value) < np.inf}
            writer.add_message(channel, at, json.dumps(data).encode(), at)
        writer.add_metadata("recording", {k: str(_text_or_number(v)) for k, v in recording.metadata.items()})
        writer.finish()


_WRITERS: dict[str, Callable[[Recording, Path, bool], None]] = {
    ".csv": _csv, ".csv.gz": _csv, ".mat": _mat, ".h5": _hdf5, ".hdf5": _hdf5,
    ".parquet": _parquet, ".mcap": _mcap,
}  # fmt: skip


def _unit(recording: Recording, name: str) -> str:
    return for_axis(COLUMN_UNITS.get(name, "1"), str(recording.metadata.get("axis", "linear")))


def _identifier(name: str) -> str:
    """Return `name` as a MATLAB variable or field: at most 63 letters, digits and _, a letter first."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return (plain if plain[:1].isalpha() else f"x{plain}")[:63]


def _text_or_number(value: Any) -> Any:
    """Return `value` as every format holds it: text and numbers as they are, all else as JSON."""
    if isinstance(value, bool):
        return int(value)
    return value if isinstance(value, str | int | float) else json.dumps(value)
