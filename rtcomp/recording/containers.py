"""MAT (5 and 7.3) and HDF5 files into a table.

Whatever the nesting, every numeric vector becomes a column by its own name, or by its path
(``log.motor.position``) where two have the same; single numbers and texts become metadata.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rtcomp.errors import RecordingError
from rtcomp.recording.events import read_events
from rtcomp.recording.superblock import END_OF_FILE, FLAGS, SIGNATURE, SIZE, VERSION
from rtcomp.recording.table import Floats, Table

LONG = 250_000
"""Rows from which on a column that nobody asked for stays in its file."""


def read_mat5(path: Path) -> Table:
    """Read a MATLAB 5 file; raise RecordingError where it is truncated or damaged."""
    from scipy.io import loadmat

    from rtcomp.recording import mat5

    try:
        mat5.check(path.read_bytes())
        content = loadmat(path, simplify_cells=True)
    except Exception as error:  # the library meets a cut-off file with a dozen kinds of error
        raise RecordingError(f"{path}: is truncated or damaged: {_line(error)}") from None
    return _table({k: v for k, v in content.items() if not k.startswith("__")})


def read_hdf5(path: Path, only: Collection[str] | None = None) -> Table:
    """Read an HDF5 file: the program's own (also after a kill, also while being written) or MATLAB 7.3.

    Of long columns (a quarter of a million rows) those whose name is not in `only` are left out. Raises
    RecordingError where it is truncated or damaged.
    """
    import h5py

    try:
        # The way that also reads a file while it is being written; only its newer form can be read so.
        with h5py.File(path, "r", swmr=_superblock_is_new(path)) as file:
            if _ours(file):
                return _own(file, only)
            table = _table(_tree(file, only))
            table.metadata |= {k: _plain(v) for k, v in file.attrs.items()}
            return table
    except (OSError, RuntimeError, KeyError) as error:
        raise RecordingError(f"{path}: is truncated or damaged: {_line(error)}") from None


def _superblock_is_new(path: Path) -> bool:
    """Return whether the superblock has version 3; raise OSError where the file is shorter than it says.

    The library checks the length itself, but not in a file that is opened as one that may be growing. One
    that carries the flags of being written may be shorter until its next flush.
    """
    with path.open("rb") as file:
        block = file.read(SIZE)
        if block[:8] != SIGNATURE or len(block) < SIZE or block[VERSION] != 3:
            return False
        end = int.from_bytes(block[END_OF_FILE : END_OF_FILE + 8], "little")
        size = file.seek(0, os.SEEK_END)
        if size < end and not block[FLAGS]:
            raise OSError(f"{end - size} bytes are missing")
    return True


def _ours(file: Any) -> bool:
    return str(file.attrs.get("format", "")).startswith("rtcomp recording")


def _wanted(item: Any, name: str, only: Collection[str] | None) -> bool:
    """Return whether the dataset `name` is to be read: short, or asked for by name or by path."""
    if only is None or item.size <= LONG:
        return True
    return name in only or any(one.rsplit(".", 1)[-1].partition(":")[0] == name for one in only)


def _own(file: Any, only: Collection[str] | None) -> Table:
    """Read a recording of the program's own, cut to the rows that all its columns have."""
    metadata = {key: _plain(value) for key, value in file.attrs.items()}
    datasets = {name: item for name, item in file.items() if getattr(item, "ndim", 0) == 1}
    columns = {name: item[()] for name, item in datasets.items() if _wanted(item, name, only)}
    notes = []
    rows = min((len(column) for column in columns.values()), default=0)
    if not metadata.get("complete"):
        ended = metadata.get("ended", "no")
        notes.append(
            "the recording has no end (being written, or its recorder was killed): read to its last flush"
            if ended == "no"
            else f"the recording did not end as it should ({ended})"
        )
    if metadata.get("rows_lost"):
        notes.append(f"the recorder lost {metadata['rows_lost']} rows")
    events = read_events(file)
    weights = None
    if "weights" in file:
        time, learnt = file["weights/time"][()], file["weights/weights"][()]
        weights = time[: len(learnt)], learnt[: len(time)]
    return Table({name: column[:rows] for name, column in columns.items()}, metadata, notes, weights, events)


def _tree(group: Any, only: Collection[str] | None) -> dict[str, Any]:
    """Read a group into nested dicts as `loadmat` makes them; MATLAB's own bookkeeping is left out."""
    import h5py

    tree: dict[str, Any] = {}
    for name, item in group.items():
        if name.startswith("#"):
            continue
        if isinstance(item, h5py.Group):
            tree[name] = _tree(item, only)
        elif isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub" and _wanted(item, name, only):
            if item.attrs.get("MATLAB_class") == b"char":
                tree[name] = "".join(map(chr, np.ravel(item[()])))
            elif not item.attrs.get("MATLAB_empty", 0):
                tree[name] = item[()]
    return tree


def _table(tree: Mapping[str, Any]) -> Table:
    """Flatten nested dicts of arrays."""
    table = Table({})
    if isinstance(learnt := tree.get("weights"), Mapping) and {"time", "weights"} <= learnt.keys():
        weights = np.atleast_2d(np.asarray(learnt["weights"], dtype=np.float64))
        times = np.ravel(np.asarray(learnt["time"], dtype=np.float64))
        table.weights = times, weights if len(weights) == len(times) else weights.T
        tree = {name: value for name, value in tree.items() if name != "weights"}
    vectors: dict[str, Floats] = {}
    for where, value in _leaves(tree, ""):
        where = where.removeprefix("metadata.")
        if isinstance(value, str):
            table.metadata[where] = _plain(value)
            continue
        array = np.squeeze(np.asarray(value))
        if array.dtype.kind not in "fiub":
            continue
        array = array.astype(np.float64, copy=False)
        if array.ndim == 0:
            table.metadata[where] = float(array)
        elif array.ndim == 1:
            vectors[where] = array
        elif array.ndim == 2 and min(array.shape) <= 16:
            tall = array if array.shape[0] >= array.shape[1] else array.T
            vectors |= {f"{where}:{i + 1}": np.ascontiguousarray(tall[:, i]) for i in range(tall.shape[1])}
    last = [where.rsplit(".", 1)[-1] for where in vectors]
    for where, vector in vectors.items():
        short = where.rsplit(".", 1)[-1]
        table.columns[short if last.count(short) == 1 else where] = vector
    return table


def _leaves(tree: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for name, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{name}.")
        elif isinstance(value, list):
            inside = {f"{name}:{i + 1}": item for i, item in enumerate(value)}
            yield from _leaves(inside, prefix)
        else:
            yield f"{prefix}{name}", value


def _plain(value: Any) -> Any:
    """Return an attribute as Python has it: text, numbers, lists; JSON text as what it says."""
    if isinstance(value, bytes):
        value = value.decode(errors="replace")
    if hasattr(value, "tolist"):
        value = value.tolist()
        value = value.decode(errors="replace") if isinstance(value, bytes) else value
    if isinstance(value, str) and value[:1] in ("{", "["):
        try:
            return json.loads(value)
        except ValueError:
            return value
    return value


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
