"""`rtcomp diagnose` from recording to answer, on a simulated axis with a concealed effect."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import yaml
from command import in_a_terminal, refused, rtcomp, write

from rtcomp.stage.stage import Stage

CONFIG = """\
stage:
  mass: 2.0
  force_constant: 4.0
  voltage_limit: 10.0
  viscous: 8.0
  micro_damping: 250.0
  friction:
    - {stiffness: 3.2e5, reach: 1.5e-6}
    - {stiffness: 1.3e5, reach: 7.0e-6}
    - {stiffness: 4.0e4, reach: 2.4e-5}
sensor: {noise: 1.5e-8, resolution: 1.0e-8}
controller: {kp: 2.0e4, ki: 2.0e5, kd: 100.0}
rate: 1000.0
reference: {kind: multisine, amplitude: 7.0e-4, band: {low: 0.1, high: 2.0, count: 7}, duration: 20.0}
device: {driver: simulated, delay_ticks: 0}
"""
COGGING = "  effects: [{name: cogging, amplitude: 0.6, period: 5.0e-4, phase: 0.3}]\n"
VERDICTS = {"consistent", "retuned", "missing-physics", "unexplained"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The believed stage, and recordings of the same with cogging and without."""
    folder = tmp_path_factory.mktemp("diagnose")
    (folder / "stage.yaml").write_text(CONFIG)
    (folder / "cogging.yaml").write_text(CONFIG.replace("sensor:", f"{COGGING}sensor:"))
    for name in ("stage", "cogging"):
        run = rtcomp("simulate", f"{name}.yaml", "--out", f"recorded-{name}", "--json", at=folder)
        assert run.returncode == 0, run.stderr
        shutil.copy(folder / f"recorded-{name}" / "recording.h5", folder / f"{name}.h5")
    return folder


@pytest.fixture(scope="module")
def diagnosed(folder: Path) -> dict[str, Any]:
    run = rtcomp("diagnose", "cogging.h5", "--stage", "stage.yaml", "--out", "out", "--force", "--json",
                 at=folder, timeout=600)  # fmt: skip
    assert (run.returncode, run.stderr) == (0, "")
    answer: dict[str, Any] = json.loads(run.stdout)
    return answer


def test_the_answer_is_the_contracts_and_the_same_in_the_folder(
    folder: Path, diagnosed: dict[str, Any]
) -> None:
    written = json.loads((folder / "out" / "diagnosis.json").read_text())
    assert {**written, "out": "out"} == diagnosed
    assert written["verdict"] in VERDICTS
    assert {"where", "retuned", "effects", "fit", "not_observable"} <= written.keys()
    errors = written["fit"]["relative_force_error"]
    assert errors.keys() == {"before", "retuned", "after", "floor"}
    for effect in written["effects"]:
        assert effect["names"] and 0.0 <= effect["probability"] <= 1.0
        for value in effect["parameters"].values():
            assert value["low"] <= value["value"] <= value["high"] and value["unit"]
    assert ("next_experiment" in written) == (folder / "out" / "reference.yaml").exists()


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [
        ("--budget", "0.001", ["budget of 0.001 s", "give it more"]),
        ("--budget", "0", ["0", "x>0"]),
        ("--input", "stepped", ["stepped", "held", "band-limited"]),
    ],
)
def test_bad_options(folder: Path, option: str, value: str, says: list[str]) -> None:
    given = ("--stage", "stage.yaml", "--out", "new", option, value)
    refused("diagnose", "stage.h5", *given, at=folder, says=says)
    assert not (folder / "new").exists()


def test_another_unit_is_refused_in_one_line_or_assumed_and_said(folder: Path) -> None:
    with h5py.File(folder / "stage.h5") as file:
        columns = {name: file[name][()] for name in ("time", "position", "reference", "voltage")}
    rows = np.column_stack(
        [1e3 * columns["time"], *(columns[n] for n in ("position", "reference", "voltage"))]
    )
    header = "time,position,reference,voltage"
    np.savetxt(folder / "ms.csv", rows, delimiter=",", header=header, comments="")
    given = ("diagnose", "ms.csv", "--stage", "stage.yaml")
    refused(*given, "--out", "ms", at=folder, says=["time in ms", "1 Hz", "--assume-units"])
    assert not (folder / "ms").exists()
    run = rtcomp(*given, "--out", "ms", "--assume-units", at=folder, timeout=600)
    assert (run.returncode, run.stderr) == (0, "")
    assert "time is taken to be in ms" in run.stdout


def test_the_concealed_effect_is_named_and_explains_the_recording(diagnosed: dict[str, Any]) -> None:
    assert diagnosed["verdict"] == "missing-physics"
    (effect,) = diagnosed["effects"]
    assert effect["names"] == ["cogging"]
    assert effect["parameters"]["period"]["value"] == pytest.approx(5e-4, rel=0.02)
    assert effect["parameters"]["amplitude"]["value"] == pytest.approx(0.6, rel=0.1)
    errors = diagnosed["fit"]["relative_force_error"]
    assert errors["after"] < 0.2 * errors["before"]


def test_the_extended_stage_loads_simulates_and_replays_better(
    folder: Path, diagnosed: dict[str, Any]
) -> None:
    assert [e.name for e in Stage.load(folder / "out" / "stage.yaml").chain].count("cogging") == 1
    errors = []
    for stage in ("stage.yaml", "out/stage.yaml"):
        run = rtcomp(
            "replay", "cogging.h5", "--stage", stage, "--out", "replay.csv", "--force", "--json", at=folder
        )
        assert run.returncode == 0, run.stderr
        errors.append(json.loads(run.stdout)["relative_force_error"])
    assert errors[1] < 0.2 * errors[0]


def test_the_report_opens_with_the_verdict(folder: Path, diagnosed: dict[str, Any]) -> None:
    page = (folder / "out" / "report.html").read_text()
    assert "Missing: cogging" in page and "cogging.h5 against stage.yaml" in page
    assert page.index("Missing: cogging") < page.index("Force error, as believed")


def test_nothing_missing_is_said_to_a_person_with_status_0(folder: Path) -> None:
    run = rtcomp("diagnose", "stage.h5", "--stage", "stage.yaml", "--out", "clean", at=folder, timeout=600)
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout.startswith(("Nothing is missing", "No physics is missing"))
    assert "Force error" in run.stdout and "Report: clean/report.html" in run.stdout


def test_names_of_columns_and_notes_of_reading_arrive_in_the_answer(folder: Path, tmp_path: Path) -> None:
    with h5py.File(folder / "cogging.h5") as file:
        columns = {name: file[name][()] for name in ("time", "position", "voltage")}
    jittered = columns["time"] + 2e-5 * np.random.default_rng(1).standard_normal(columns["time"].size)
    rows = np.delete(np.sort(np.append(np.arange(jittered.size), 500)), slice(9000, 9040))
    write(tmp_path / "log.csv", {"t": jittered[rows], "qm": columns["position"][rows],
                                 "vir": columns["voltage"][rows]})  # fmt: skip
    shutil.copy(folder / "stage.yaml", tmp_path)
    run = rtcomp(
        "diagnose", "log.csv", "--stage", "stage.yaml", "--out", "out", "--json", "--map", "time=t",
        "--map", "position=qm", "--map", "voltage=vir", at=tmp_path, timeout=600,
    )  # fmt: skip
    assert (run.returncode, run.stderr) == (0, "")
    answer = json.loads(run.stdout)
    notes = " ".join(answer["notes"])
    assert "of a time already seen" in notes and "gap" in notes
    assert any("cogging" in effect["names"] for effect in answer["effects"])


def test_earlier_results_stay_unless_they_are_to_be_replaced(folder: Path, diagnosed: dict[str, Any]) -> None:
    refused("diagnose", "cogging.h5", "--stage", "stage.yaml", "--out", "out", at=folder, says=["--force"])


def test_the_next_experiment_is_a_reference_that_runs(folder: Path, diagnosed: dict[str, Any]) -> None:
    path = folder / "out" / "reference.yaml"
    if not path.exists():
        assert "next_experiment" not in diagnosed
        return
    assert yaml.safe_load(path.read_text()).keys() == {"reference"}
    run = rtcomp("simulate", "out/stage.yaml", "--reference", "out/reference.yaml", "--out", "next", "--json",
                 at=folder)  # fmt: skip
    assert run.returncode == 0, run.stderr


def test_the_place_is_shown_on_the_terminal_before_anything_is_named(folder: Path) -> None:
    shown = in_a_terminal(
        "diagnose", "cogging.h5", "--stage", "stage.yaml", "--out", "shown", "--force", at=folder
    )
    place, rest = shown.index("Refitted, the stage leaves"), shown.index("search")
    assert place < shown.index("periodic in position: period 5") < rest < shown.index("Missing: cogging")
