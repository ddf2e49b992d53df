"""A table as a file holds it, before anything is asked of it; and what a file is, by its content."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rtcomp.errors import RecordingError
from rtcomp.recording.events import Event

Floats = npt.NDArray[np.float64]


@dataclass
class Table:
    """Columns by name, 1-D float64, not necessarily of one length yet; metadata; what was noticed."""

    columns: dict[str, Floats]
    metadata: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    weights: tuple[Floats, Floats] | None = None
    """The identifier's weights: times (n,) in s and weights (n, N)."""
    events: list[Event] = field(default_factory=list)


CSV, GZIP, MAT5, HDF5 = "CSV text", "a gzip file", "a MATLAB 5 file", "an HDF5 file"
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"

_STRANGERS: tuple[tuple[bytes, str], ...] = (
    (b"PAR1", "a Parquet file"),
    (b"\x89MCAP0\r\n", "an MCAP file"),
    (b"PK\x03\x04", "a ZIP archive (a spreadsheet or .npz, perhaps)"),
    (b"\x93NUMPY", "a NumPy array file"),
    (b"\xd0\xcf\x11\xe0", "an old Excel or other Office file"),
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a PNG picture"),
    (b"BZh", "a bzip2 file"),
    (b"\xfd7zXZ", "an xz file"),
    (b"\x28\xb5\x2f\xfd", "a zstd file"),
    (b"SQLite format 3", "an SQLite database"),
    (b"\x7fELF", "a program"),
)

_EXPECTED: dict[str, tuple[str, ...]] = {
    ".csv": (CSV,), ".txt": (CSV,), ".tsv": (CSV,), ".dat": (CSV,), ".gz": (GZIP,),
    ".mat": (MAT5, HDF5), ".h5": (HDF5,), ".hdf5": (HDF5,), ".hdf": (HDF5,),
}  # fmt: skip


def recording_in(folder: Path) -> Path:
    """Return the one file in `folder` that is a recording by its name.

    Raises RecordingError, saying what is there, where none is or several are.
    """
    try:
        names = sorted(path.name for path in folder.iterdir() if path.is_file())
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be read: {error.strerror}") from None
    found = [name for name in names if Path(name.lower()).suffix in _EXPECTED]
    if len(found) == 1:
        return folder / found[0]
    if found:
        raise RecordingError(f"{folder}: is a folder with {len(found)} recordings; name one: {_few(found)}")
    there = f"it holds {_few(names)}" if names else "it is empty"
    raise RecordingError(f"{folder}: is a folder without a recording (.csv, .csv.gz, .mat, .h5); {there}")


def _few(names: list[str], most: int = 8) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def kind(path: Path) -> str:
    """Return what the file at `path` is by its content: CSV, GZIP, MAT5 or HDF5.

    Raises RecordingError where it is missing, a folder, empty, of a kind that is not read, or not what its
    name says.
    """
    if path.is_dir():
        raise RecordingError(f"{path}: is a folder; name the recording in it")
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except FileNotFoundError:
        raise RecordingError(f"{path}: there is no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    if not head:
        raise RecordingError(f"{path}: is empty")
    found = kind_of(head)
    readable = (CSV, GZIP, MAT5, HDF5)
    suffix = path.suffix.lower()
    # A MATLAB 7.3 file is HDF5 behind a header of its own; without it, it is plain HDF5.
    plain = suffix == ".mat" and head.startswith(_HDF5_SIGNATURE)
    if plain or found not in _EXPECTED.get(suffix, readable):
        what = "is not what its name says: it " if suffix in _EXPECTED else ""
        do = "rename it" if found in readable else "readable are CSV, CSV.gz, MAT and HDF5"
        raise RecordingError(f"{path}: {what}looks like {found}; {do}")
    return found


def kind_of(head: bytes) -> str:
    """Return what a file is that begins with `head`: one of the kinds that are read, or another's name."""
    if head.startswith(b"\x1f\x8b"):
        return GZIP
    if any(head[start : start + 8] == _HDF5_SIGNATURE for start in (0, 512, 1024, 2048)):
        return HDF5
    if head.startswith(b"MATLAB 7.3"):
        return HDF5  # cut off or damaged before its HDF5 part; reading it says so
    if head.startswith(b"MATLAB 5.0") or (
        len(head) >= 128 and head[124:128] in (b"\x00\x01IM", b"\x01\x00MI")
    ):
        return MAT5
    for magic, name in _STRANGERS:
        if head.startswith(magic):
            return name
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return CSV  # UTF-16 text, as spreadsheets write it
    return "binary data of an unknown kind" if b"\0" in head else CSV
