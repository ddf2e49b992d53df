"""Where results would go: what is there is replaced only when asked, and stays where a run fails."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command import (
    CONFIG,
    arguments,
    listing,
    one_error_line,
    refused,
    rtcomp,
    with_earlier_results,
)

LOOPS = ("identify", "compensate", "simulate")


@pytest.fixture()
def folder(tmp_path: Path) -> Path:
    return with_earlier_results(tmp_path)


@pytest.mark.parametrize("command", LOOPS)
def test_an_output_that_exists_is_replaced_only_when_asked(folder: Path, command: str) -> None:
    (folder / "run.yaml").write_text(CONFIG)
    given = [word for word in arguments(command) if word != "--force"]
    refused(*given, at=folder, says=["results exists and is not empty", "--force"])
    (folder / "file").write_text("mine")
    for force in ([], ["--force"]):
        refused(command, "run.yaml", "--out", "file", *force, at=folder, says=["file is a file"])
    run = rtcomp(*arguments(command), at=folder)
    assert (run.returncode, run.stderr) == (0, "")
    assert json.loads(run.stdout)["out"] == "results"
    name = "with.h5" if command == "compensate" else "recording.h5"
    assert readable_rows(folder / "results" / name) > 1000


@pytest.mark.parametrize("command", ["replay", "convert"])
def test_an_output_file_that_exists_is_replaced_only_when_asked(folder: Path, command: str) -> None:
    (folder / "run.yaml").write_text(CONFIG)
    (folder / "replay.csv").write_text("mine")
    given = arguments("replay") if command == "replay" else ["convert", "recording.csv", "replay.csv"]
    refused(*given, at=folder, says=["replay.csv", "exists", "--force"])
    (folder / "recording.csv").write_text((folder / "recording.csv").read_text().replace("voltage", "volts"))
    refused(*given, "--force", at=folder, says=["no column 'voltage'"])
    assert (folder / "replay.csv").read_text() == "mine"


def test_a_run_that_fails_on_the_way_leaves_the_old_results(folder: Path) -> None:
    """A wrong sign of the feedback drives the stage out of its travel while it runs."""
    text = CONFIG.replace("travel: [-1.0e-3, 1.0e-3]", "travel: [-7.0e-5, 7.0e-5]")
    text = text.replace("force: 0.1", "force: 30.0").replace("ki: 2.0e5", "ki: 0.0")
    (folder / "run.yaml").write_text(text.replace("amplitude: 1.0e-4, freq", "amplitude: 5.0e-5, freq"))
    before = listing(folder / "results")
    run = rtcomp(*arguments("identify"), at=folder)
    line = one_error_line(run, ["left the travel", "zero volts", "results.failed"])
    assert "kept in results.failed" in line
    assert listing(folder / "results") == before
    assert readable_rows(folder / "results.failed" / "recording.h5") > 0
    assert sorted(p.name for p in folder.iterdir()) == [
        "recording.csv", "results", "results.failed", "run.yaml",
    ]  # fmt: skip


def readable_rows(path: Path) -> int:
    """Rows of a recording that h5py reads, columns of one length."""
    import h5py

    with h5py.File(path, "r") as file:
        lengths = {len(file[name]) for name in ("time", "position", "voltage")}
    assert len(lengths) == 1
    return lengths.pop()


def test_places_that_cannot_be_written(folder: Path) -> None:
    (folder / "run.yaml").write_text(CONFIG)
    for out in ("/dev/null/out", "/proc/out"):
        given = [out if word == "results" else word for word in arguments("simulate")]
        refused(*given, at=folder, says=[f"{out} cannot be written"])
