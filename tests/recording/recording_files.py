"""Recordings for tests, in every format, where the measured ones are, and how one is refused."""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt
import pytest
from scipy.io import savemat

from rtcomp.errors import RecordingError
from rtcomp.recording.reader import read

Floats = npt.NDArray[np.float64]
DATA = Path(__file__).parents[3] / "shared" / "data"


def data(name: str) -> Path:
    """The measured recording `name`, or skip the test and say so."""
    path = DATA / name
    if not path.exists():
        pytest.skip(f"needs the data folder: {path} is not there")
    return path


def motion(rows: int = 500, rate: float = 1000.0) -> dict[str, Floats]:
    """A recording of an axis that follows a sine, with sensor noise."""
    time = np.arange(rows) / rate
    chance = np.random.default_rng(1)
    reference = 1e-4 * np.sin(2 * np.pi * 3.0 * time)
    return {
        "time": time,
        "reference": reference,
        "position": reference + 2e-8 * chance.standard_normal(rows),
        "voltage": 2.0 * np.cos(2 * np.pi * 3.0 * time) + 1e-3 * chance.standard_normal(rows),
    }


def write_csv_text(path: Path, columns: Mapping[str, Floats], separator: str = ",", end: str = "\n") -> Path:
    """Independent of the program's own writer."""
    lines = [separator.join(columns)]
    lines += [separator.join(f"{value:.17g}" for value in row) for row in zip(*columns.values(), strict=True)]
    text = (end.join(lines) + end).encode()
    path.write_bytes(gzip.compress(text) if path.suffix == ".gz" else text)
    return path


def write_mat5(path: Path, columns: Mapping[str, Floats], compress: bool = False) -> Path:
    savemat(path, dict(columns), oned_as="column", do_compression=compress)
    return path


def write_mat73(path: Path, tree: Mapping[str, object], oned: str = "row") -> Path:
    """A file as MATLAB 7.3 writes it: HDF5 behind 512 bytes of its own, arrays two-dimensional."""

    def fill(group: h5py.Group, tree: Mapping[str, object]) -> None:
        for name, value in tree.items():
            if isinstance(value, Mapping):
                fill(group.create_group(name), value)
                group[name].attrs["MATLAB_class"] = np.bytes_("struct")
            elif isinstance(value, str):
                group[name] = np.array([[ord(letter)] for letter in value], dtype=np.uint16)
                group[name].attrs["MATLAB_class"] = np.bytes_("char")
            else:
                array = np.atleast_2d(np.asarray(value, dtype=float))
                group[name] = array if oned == "row" else array.T
                group[name].attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        fill(file, tree)
        fill(file, {"#refs#": {"a": [1.0, 2.0]}})
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as file:
        file.write(header)
    return path


def write_hdf5(path: Path, columns: Mapping[str, Floats], **attributes: object) -> Path:
    with h5py.File(path, "w") as file:
        for name, column in columns.items():
            file[name] = column
        for name, value in attributes.items():
            file.attrs[name] = json.dumps(value) if isinstance(value, dict) else value
    return path


def write_any(path: Path, columns: Mapping[str, Floats]) -> Path:
    """Write the format that `path` names; ``.73.mat`` is MATLAB 7.3."""
    if path.name.endswith(".73.mat"):
        return write_mat73(path, columns)
    if path.suffix == ".mat":
        return write_mat5(path, columns)
    return write_hdf5(path, columns) if path.suffix == ".h5" else write_csv_text(path, columns)


FORMATS = ["a.csv", "a.csv.gz", "a.mat", "a.73.mat", "a.h5"]


def refusal(path: Path, *arguments: object, **options: object) -> str:
    """The one line with which reading `path` is refused."""
    with pytest.raises(RecordingError) as caught:
        read(path, *arguments, **options)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)
    return str(caught.value)
