"""`rtcomp inspect` as a user runs it: what it prints and writes, and input that it cannot use."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from command import CONFIG, listing, refused, rtcomp, write

from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel

TESTS = ("symmetry", "congruency", "closure", "rate_dependence")
VERDICTS = {"holds", "fails", "undecided", "not-testable"}


def loops(seconds: float = 8.0) -> dict[str, np.ndarray]:
    """A recording of a hysteresis with loops of two sizes."""
    time = np.arange(round(500 * seconds)) / 500.0
    size = np.where(time % 4.0 < 2.0, 1.0, 0.5)
    position = 1e-4 * size * np.sin(2 * np.pi * time)
    model = HysteresisModel(IntervalBasis(np.array([2e-5, 6e-5, 1e-4])), np.array([4e4, 2e4, 5e3]))
    return {"time": time, "position": position, "voltage": model.response(position) / 4.0}


@pytest.fixture()
def folder(tmp_path: Path) -> Path:
    write(tmp_path / "log.csv", loops())
    (tmp_path / "run.yaml").write_text(CONFIG.replace("  map: {position: qm}\n", ""))
    return tmp_path


def test_it_prints_figures_and_one_answer_for_each_test(folder: Path) -> None:
    run = rtcomp("inspect", "log.csv", "--stage", "run.yaml", at=folder)
    assert (run.returncode, run.stderr) == (0, "")
    for name in ("Symmetry", "Congruency", "Closure", "Rate"):
        assert len(re.findall(rf"^{name}: .+\.$", run.stdout, re.MULTILINE)) == 1
    assert "Mirrored branch over branch" in run.stdout and "no stage" not in run.stdout
    assert set(listing(folder)) == {"log.csv", "run.yaml"}


def test_without_a_stage_it_says_that_the_voltage_is_the_force(folder: Path) -> None:
    run = rtcomp("inspect", "log.csv", at=folder)
    assert (run.returncode, run.stderr) == (0, "")
    assert "Note: no stage was given: the column voltage is taken as the force" in run.stdout
    assert re.search(r"Force range +[\d.]+ m?V", run.stdout)


def test_json_is_the_file_with_the_folder_added(folder: Path) -> None:
    run = rtcomp("inspect", "log.csv", "--out", "out", "--json", at=folder)
    assert (run.returncode, run.stderr) == (0, "")
    printed = json.loads(run.stdout)
    assert {p.name for p in (folder / "out").iterdir()} == {"inspect.html", "inspect.json", ".rtcomp-files"}
    assert printed == {**json.loads((folder / "out" / "inspect.json").read_text()), "out": "out"}
    for name in TESTS:
        assert printed[name]["verdict"] in VERDICTS and printed[name]["says"]
    page = (folder / "out" / "inspect.html").read_text()
    assert page.startswith("<!DOCTYPE html>") and "Congruency: all branches from a common origin" in page
    assert "default-src 'none'" in page  # it opens without a network


def test_every_name_in_the_file_stands_on_the_formats_page(folder: Path) -> None:
    rtcomp("inspect", "log.csv", "--out", "out", at=folder)
    page = (Path(__file__).parents[2] / "docs" / "formats.md").read_text()
    part = page[page.index("\n## An inspection\n") :]
    code = set(re.findall(r"[\w]+", " ".join(re.findall(r"`([^`\n]+)`", part[: part.index("\n## ", 5)]))))

    def names(value: object) -> set[str]:
        return (
            set(value) | {n for v in value.values() for n in names(v)} if isinstance(value, dict) else set()
        )

    assert names(json.loads((folder / "out" / "inspect.json").read_text())) - code == set()


def test_an_earlier_result_stands_unless_forced(folder: Path) -> None:
    assert rtcomp("inspect", "log.csv", "--out", "out", at=folder).returncode == 0
    refused("inspect", "log.csv", "--out", "out", at=folder, says=["out exists and is not empty", "--force"])
    run = rtcomp("inspect", "log.csv", "--out", "out", "--force", "--settle", "3", at=folder)
    assert (run.returncode, run.stderr) == (0, "")


def test_a_configuration_says_how_the_file_calls_its_columns(folder: Path) -> None:
    columns = loops()
    write(folder / "own.mat", {"t": columns["time"], "qm": columns["position"], "u": columns["voltage"]})
    text = (folder / "run.yaml").read_text()
    (folder / "run.yaml").write_text(
        re.sub(r"recording:\n", "recording:\n  map: {time: t, position: qm, voltage: u}\n", text)
    )
    run = rtcomp("inspect", "own.mat", "--stage", "run.yaml", "--json", at=folder)
    assert (run.returncode, run.stderr) == (0, "")
    assert json.loads(run.stdout)["force_unit"] == "N"
    maps = [word for name in ("time=t", "position=qm", "voltage=u") for word in ("--map", name)]
    run = rtcomp("inspect", "own.mat", *maps, "--json", at=folder)
    assert json.loads(run.stdout)["position_unit"] == ""  # nobody said what qm is in


ARGUMENTS = ("inspect", "bad.csv", "--out", "results", "--json")


@pytest.mark.parametrize(
    ("what", "says"),
    [
        ("one direction", ["bad.csv: the position only rises", "two reversals or more", "--reversal"]),
        ("constant position", ["position is constant (0.003 in all 4000 rows)"]),
        ("few rows", ["bad.csv: 40 rows; an inspection needs at least 64"]),
        ("no voltage", ["has no column 'voltage'", "--map voltage=COLUMN"]),
        ("not finite", ["position is NaN in row 8", "1 of its 4000 values"]),
        ("constant voltage", ["the force is 1 all along", "--map voltage=COLUMN"]),
        ("unreadable", ["bad.csv: ", "row"]),
        ("noise alone", ["the whole stroke only", "no loop"]),
    ],
)
def test_a_recording_that_cannot_be_used_is_one_line(folder: Path, what: str, says: list[str]) -> None:
    columns = loops()
    rows = columns["time"].size
    if what == "one direction":
        columns["position"] = 1e-3 * columns["time"]
    elif what == "constant position":
        columns["position"] = np.full(rows, 3e-3)
    elif what == "few rows":
        columns = {name: column[:40] for name, column in columns.items()}
    elif what == "no voltage":
        del columns["voltage"]
    elif what == "not finite":
        columns["position"][7] = np.nan
    elif what == "constant voltage":
        columns["voltage"] = np.ones(rows)
    elif what == "noise alone":
        columns["position"] = 1e-9 * np.random.default_rng(1).standard_normal(rows)
    write(folder / "bad.csv", columns)
    if what == "unreadable":
        text = (folder / "bad.csv").read_text().splitlines()
        (folder / "bad.csv").write_text("\n".join([*text[:20], "0.04,broken", *text[20:]]))
    refused(*ARGUMENTS, at=folder, says=says)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--smoothing", "250"], ["--smoothing is 250 Hz; allowed is [0, 250)"]),
        (["--smoothing", "-1"], ["--smoothing", "-1"]),
        (["--smoothing", "nan"], ["not a finite number"]),
        (["--reversal", "0"], ["--reversal", "0"]),
        (["--reversal", "1"], ["--reversal is 1, the whole stroke only 0.0002"]),
        (["--settle", "8"], ["--settle is 8 s; the recording lasts 7.998 s"]),
        (["--settle", "7.9"], ["after --settle 7.9 s there is no rising and falling branch"]),
        (["--stage", "none.yaml"], ["none.yaml"]),
        (["--rate", "0"], ["is not a rate"]),
        (["--map", "position=qm"], ["has no column 'qm' for position"]),
        (["--smoothign", "1"], ["no option --smoothign; did you mean --smoothing?"]),
    ],
)
def test_options_that_make_no_sense_are_one_line(folder: Path, options: list[str], says: list[str]) -> None:
    refused("inspect", "log.csv", "--out", "results", *options, at=folder, says=says)


def test_the_options_change_what_they_say(folder: Path) -> None:
    def of(*options: str) -> dict[str, object]:
        run = rtcomp("inspect", "log.csv", "--json", *options, at=folder)
        assert (run.returncode, run.stderr) == (0, "")
        answer = json.loads(run.stdout)
        assert isinstance(answer, dict)
        return answer

    assert of("--smoothing", "20")["smoothing_hz"] == 20.0
    assert of("--smoothing", "0")["smoothing_hz"] == 0.0
    # Of the loops of half the size none is left where a reversal is more.
    assert of("--reversal", "1.2e-4")["branches_rising"] < of()["branches_rising"]  # type: ignore[operator]
    assert of("--settle", "4")["branches_left_out"] > of("--settle", "0")["branches_left_out"]  # type: ignore[operator]
