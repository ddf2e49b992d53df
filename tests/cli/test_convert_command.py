"""`rtcomp convert` as a user runs it."""

from __future__ import annotations

import gzip
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

RTCOMP = str(Path(sys.executable).parent / "rtcomp")


def convert(*arguments: str | Path, at: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [RTCOMP, "convert", *map(str, arguments)], cwd=at, capture_output=True, text=True, timeout=120
    )


@pytest.fixture()
def folder(tmp_path: Path) -> Path:
    t = np.arange(400) / 1000.0
    rows = np.column_stack([t, 1e-6 * np.sin(20 * t), np.cos(20 * t)])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="time,qm,vir", comments="")
    return tmp_path


def test_there_and_back_keeps_every_number(folder: Path) -> None:
    one = convert("log.csv", "log.h5", "--map", "position=qm", "--map", "voltage=vir", at=folder)
    assert (one.returncode, one.stderr) == (0, "")
    assert one.stdout.startswith("log.h5: 400 rows at 1000 Hz; time, position, voltage")
    two = convert("log.h5", "back.csv.gz", at=folder)
    assert two.returncode == 0, two.stderr
    with gzip.open(folder / "back.csv.gz", "rt") as file:
        names = file.readline().strip().split(",")
        back = np.loadtxt(file, delimiter=",")
    was = np.loadtxt(folder / "log.csv", delimiter=",", skiprows=1)
    assert names[:3] == ["time", "position", "voltage"]
    np.testing.assert_array_equal(back[:, :3], was)


def test_json_says_what_a_person_is_told(folder: Path) -> None:
    run = convert("log.csv", "log.mat", "--map", "position=qm", "--map", "voltage=vir", "--json", at=folder)
    summary = json.loads(run.stdout)
    assert summary["rows"] == 400
    assert summary["rate_hz"] == pytest.approx(1000.0)
    assert summary["columns"][:3] == ["time", "position", "voltage"]


def test_an_existing_target_is_kept_unless_forced(folder: Path) -> None:
    (folder / "log.h5").write_text("precious")
    arguments = ["log.csv", "log.h5", "--map", "position=qm", "--map", "voltage=vir"]
    run = convert(*arguments, at=folder)
    assert run.returncode == 2
    assert run.stderr.startswith("error: log.h5: exists already")
    assert (folder / "log.h5").read_text() == "precious"
    assert convert(*arguments, "--force", at=folder).returncode == 0
    assert (folder / "log.h5").read_bytes().startswith(b"\x89HDF")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["none.csv", "a.h5"], "none.csv: "),
        (["log.csv", "a.h5"], "position"),
        (["log.csv", "a.xlsx"], "a.xlsx: unknown kind of target"),
        (["log.csv", "log.csv"], "log.csv: is the recording itself"),
        (["log.csv", "a.h5", "--map", "position"], "--map 'position': write NAME=COLUMN"),
        (["log.csv", "a.h5", "--rate", "-1"], "'-1' is not a rate; give a positive number of Hz"),
        (["log.csv", "no/such/a.h5", "--map", "position=qm", "--map", "voltage=vir"], "there is no folder"),
    ],
)
def test_unusable_input_is_one_line_and_leaves_nothing(folder: Path, arguments: list[str], says: str) -> None:
    before = sorted(folder.iterdir())
    run = convert(*arguments, at=folder)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith("error: ") and run.stderr.count("\n") == 1
    assert says in run.stderr
    assert sorted(folder.iterdir()) == before
