"""Recordings that cannot be used, on every command that reads one: one line, nothing written or lost."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command import CONFIG, motion, refused, rtcomp, write

FORMATS = ["log.csv", "log.h5", "log.mat", "log.73.mat"]
COMMANDS = ("convert", "identify", "replay", "simulate", "inspect")
Columns = dict[str, np.ndarray]


@pytest.fixture()
def folder(tmp_path: Path) -> Path:
    """A folder with a configuration and results of earlier runs, which must survive."""
    text = CONFIG.replace("  rate: 1000.0\n  map: {position: qm}\n", "  delay_ticks: 0\n")
    (tmp_path / "run.yaml").write_text(text)
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "recording.h5").write_bytes(b"of an earlier run")
    (tmp_path / "replay.csv").write_text("of an earlier run\n")
    (tmp_path / "other.h5").write_bytes(b"of an earlier run")
    return tmp_path


def arguments(command: str, recording: str) -> list[str]:
    """What is given to `command` so that it reads `recording`, with earlier results in its way."""
    return {
        "convert": ["convert", recording, "other.h5", "--force", "--json"],
        "identify": ["identify", "run.yaml", recording, "--out", "results", "--force", "--json"],
        "simulate": ["simulate", "run.yaml", "--voltage", recording, "--out", "results", "--force", "--json"],
        "inspect": ["inspect", recording, "--stage", "run.yaml", "--out", "results", "--force", "--json"],
        "replay": ["replay", recording, "--stage", "run.yaml", "--out", "replay.csv", "--force", "--json"],
    }[command]


def changed(name: str, value: float, rows: slice | list[int]) -> Callable[[Columns], Columns]:
    def change(columns: Columns) -> Columns:
        columns[name] = columns[name].copy()
        columns[name][rows] = value
        return columns

    return change


def going_back(columns: Columns) -> Columns:
    time = columns["time"].copy()
    time[300:] -= 0.1
    return {**columns, "time": time}


UNUSABLE: list[tuple[str, Callable[[Columns], Columns], list[str], tuple[str, ...]]] = [
    ("NaN in position", changed("position", np.nan, [41, 60]), ["position is NaN in row 42", "2 of its 600"],
     ("convert", "identify", "replay", "inspect")),
    ("infinity in voltage", changed("voltage", np.inf, [7]), ["voltage is infinite in row 8", "1 of its 600"],
     COMMANDS),
    ("NaN in time", changed("time", np.nan, [7]), ["time is NaN in row 8"], COMMANDS),
    ("constant position", changed("position", 3e-3, slice(None)), ["position is constant (0.003 in all 600"],
     ("convert", "identify", "replay", "inspect")),
    ("time goes back", going_back, ["time goes back in row 301", "0.299 s to 0.2 s"], COMMANDS),
    ("too few rows", lambda c: {k: v[:9] for k, v in c.items()}, ["has 9 rows; at least 16"], COMMANDS),
    ("no voltage", lambda c: {k: v for k, v in c.items() if k != "voltage"},
     ["no column 'voltage'; found 'time', 'reference', 'position'", "--map voltage=COLUMN"], COMMANDS),
    ("other names", lambda c: {"t": c["time"], "qm": c["position"], "vir": c["voltage"]},
     ["no column", "found 't', 'qm', 'vir'", "--map time=COLUMN"], COMMANDS),
]  # fmt: skip


@pytest.mark.parametrize(
    ("command", "name", "change", "says"),
    [
        pytest.param(
            command, name, change, says, id=f"{what}-{name}-{command}",
            marks=() if (n + f) % len(commands) == c else pytest.mark.slow,
        )
        for n, (what, change, says, commands) in enumerate(UNUSABLE)
        for c, command in enumerate(commands)
        for f, name in enumerate(FORMATS)
    ],
)  # fmt: skip
def test_what_a_recording_may_not_hold(
    folder: Path, command: str, name: str, change: Callable[[Columns], Columns], says: list[str]
) -> None:
    write(folder / name, change(motion()))
    if name != "log.csv":  # these formats list their columns in an order of their own
        says = [words for words in says if "found" not in words]
    refused(*arguments(command, name), at=folder, says=[f"{name}: ", *says])


@pytest.mark.parametrize("name", ["log.h5", "log.mat", "log.73.mat"])
@pytest.mark.parametrize(
    "part", [0.0005, 0.01, 0.1, pytest.param(0.3, marks=pytest.mark.slow), 0.5, 0.9, 0.9999]
)
def test_a_truncated_file_is_called_so(folder: Path, name: str, part: float) -> None:
    path = write(folder / name, motion(3000))
    path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
    command = COMMANDS[int(10 * part) % len(COMMANDS)]
    line = refused(*arguments(command, name), at=folder, says=[f"{name}: "])
    # So short a piece shows no more what it was the beginning of.
    assert "truncated" in line or (part < 0.05 and any(w in line for w in ("not what its name", "is empty")))


def test_a_truncated_gzip_is_called_so(folder: Path) -> None:
    text = write(folder / "log.csv", motion(3000)).read_bytes()
    whole = gzip.compress(text)
    (folder / "log.csv.gz").write_bytes(whole[: len(whole) // 2])
    refused(*arguments("convert", "log.csv.gz"), at=folder, says=["log.csv.gz: ", "truncated"])


PNG = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x00\x01\x00\x00\x00\x01\x08\x00\x00\x00\x00:~\x9bU"


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("name", "made_as", "says"),
    [
        ("log.h5", "a.csv", "text"),
        ("log.mat", "a.csv", "text"),
        ("log.mat", "a.h5", "HDF5"),
        ("log.h5", "a.mat", "MATLAB 5"),
        ("log.csv", "a.h5", "HDF5"),
        ("log.csv", "a.mat", "MATLAB 5"),
        ("log.csv", "a.png", "picture"),
        ("log.h5", "a.png", "picture"),
        ("log.csv.gz", "a.csv", "text"),
        ("log.csv", "a.csv.gz", "gzip"),
    ],
)
def test_a_file_that_is_not_what_its_name_says(
    folder: Path, command: str, name: str, made_as: str, says: str
) -> None:
    made = folder / made_as
    if made_as.endswith(".png"):
        made.write_bytes(PNG + zlib.compress(b"\0\0"))
    elif made_as.endswith(".gz"):
        made.write_bytes(gzip.compress(write(folder / "b.csv", motion()).read_bytes()))
    else:
        write(made, motion())
    made.rename(folder / name)
    refused(*arguments(command, name), at=folder, says=[f"{name}: is not what its name says", says])


def test_a_recording_that_is_not_there_and_one_that_is_a_folder(folder: Path) -> None:
    (folder / "empty").mkdir()
    for command in COMMANDS:
        refused(*arguments(command, "none.h5"), at=folder, says=["none.h5: there is no such file"])
        refused(*arguments(command, "empty"), at=folder, says=["empty: is a folder"])


def test_windows_beyond_the_recording_are_named(folder: Path) -> None:
    write(folder / "log.h5", motion())
    text = (folder / "run.yaml").read_text()
    for old, new, key in (
        ("gate: 5.0e-8", "learn: [30, 40]", "identify.learn, 30 to 40 s"),
        ("settle: 0.1", "window: [30, 40]", "judge.window, 30 to 40 s"),
    ):
        (folder / "run.yaml").write_text(text.replace(old, new))
        says = ["log.h5: no row lies in", key, "takes 0.599 s"]
        refused(*arguments("identify", "log.h5"), at=folder, says=says)


def test_the_same_recordings_are_read_when_nothing_is_wrong(folder: Path) -> None:
    for name in FORMATS:
        write(folder / name, motion())
        run = rtcomp("convert", name, "other.h5", "--force", at=folder)
        assert (run.returncode, run.stderr) == (0, "")
        assert run.stdout.startswith("other.h5: 600 rows at 1000 Hz")
