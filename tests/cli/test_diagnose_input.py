"""Input that no diagnosis can be made of: one line, exit status 2, nothing written or lost."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml
from command import CONFIG, listing, refused, rtcomp, write

Columns = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Columns:
    """What `rtcomp simulate` records of the configuration of these tests."""
    folder = tmp_path_factory.mktemp("recorded")
    longer = CONFIG.replace(
        "frequency: 2.0, duration: 1.5}\nlimits", "frequency: 2.0, duration: 4.0}\nlimits"
    )
    (folder / "run.yaml").write_text(longer)
    run = rtcomp("simulate", "run.yaml", "--out", "out", "--json", at=folder)
    assert run.returncode == 0, run.stderr
    with h5py.File(folder / "out" / "recording.h5") as file:
        return {name: file[name][()] for name in ("time", "reference", "position", "voltage")}


@pytest.fixture()
def folder(tmp_path: Path) -> Path:
    """A folder with the stage and the results of an earlier diagnosis, which must survive."""
    (tmp_path / "stage.yaml").write_text(CONFIG)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "diagnosis.json").write_text("{}")
    return tmp_path


def diagnose(*recordings: str, stage: str = "stage.yaml") -> list[str]:
    return ["diagnose", *recordings, "--stage", stage, "--out", "out", "--force", "--json"]


def times(name: str, factor: float) -> Callable[[Columns], Columns]:
    return lambda c: {**c, name: factor * c[name]}


def jumped(c: Columns) -> Columns:
    return {**c, "time": np.where(np.arange(len(c["time"])) < 2000, c["time"], c["time"] + 1e4)}


UNUSABLE: list[tuple[str, Callable[[Columns], Columns], list[str]]] = [
    ("no motion", lambda c: {**c, "position": 0 * c["position"]}, ["position is constant"]),
    ("noise", lambda c: {**c, "position": 1e-8 * np.round(np.sin(np.arange(4001.0)[:len(c["time"])] ** 2))},
     ["nothing moved"]),
    ("no command", times("voltage", 0.0), ["voltage is", "V in every row"]),
    ("one direction", lambda c: {**c, "position": np.linspace(0, 1e-3, len(c["time"]))},
     ["one direction only"]),
    ("too short", lambda c: {k: v[:800] for k, v in c.items()},
     ["too short", "800 rows, 0.8 s", "at least 2 s"]),
    ("clipped", lambda c: {**c, "voltage": np.clip(c["voltage"], -0.05, 0.05)}, ["voltage is saturated"]),
    ("swapped", lambda c: {**c, "position": c["voltage"], "voltage": c["position"]}, ["are swapped"]),
    ("mm", times("position", 1e3), ["position in mm (multiply it by 0.001)", "--assume-units"]),
    ("mV", times("voltage", 1e3), ["voltage in mV or mA (multiply it by 0.001)", "--assume-units"]),
    ("um", times("position", 1e6), ["position in um (multiply it by 1e-06)", "--assume-units"]),
    ("sign", times("voltage", -1.0), ["voltage has the wrong sign"]),
    ("turned round", times("position", -1.0), ["position has the wrong sign"]),
    ("clipped sensor", lambda c: {**c, "position": np.clip(c["position"], -1e-5, 1e-5)},
     ["position is clipped", "check the sensor's range"]),
    *((f"{name} x {factor:g}", times(name, factor), says)
      for name, factor, says in (("position", 1e-3, ["1e3 times too small", "multiply it by"]),
                                 ("position", 1e-6, ["1e6 times too small", "multiply it by"]),
                                 ("voltage", 1e-3, ["voltage in kV or kA (multiply it by 1000)"]),
                                 ("voltage", 1e-6, ["voltage in MV or MA (multiply it by 1e+06)"]),
                                 ("voltage", 1e6, ["voltage in uV or uA (multiply it by 1e-06)"]))),
    ("both", lambda c: {**c, "position": 1e3 * c["position"], "voltage": 1e3 * c["voltage"]},
     ["voltage reaches", "voltage in mV or mA (multiply it by 0.001)"]),
    ("gaps", jumped, ["time jumps by"]),
    ("gaps all over", lambda c: {k: v[np.arange(len(v)) % 120 >= 20] for k, v in c.items()},
     ["gaps cut it into stretches too short", "2 s are needed"]),
    ("NaN", lambda c: {**c, "voltage": np.where(c["time"] > 2, np.nan, c["voltage"])}, ["voltage is NaN"]),
    ("no voltage", lambda c: {k: v for k, v in c.items() if k != "voltage"},
     ["no column 'voltage'", "--map"]),
]  # fmt: skip


@pytest.mark.parametrize(("change", "says"), [u[1:] for u in UNUSABLE], ids=[u[0] for u in UNUSABLE])
def test_unusable_recordings_are_refused(
    recorded: Columns, folder: Path, change: Callable[[Columns], Columns], says: list[str]
) -> None:
    write(folder / "log.csv", change(dict(recorded)))
    refused(*diagnose("log.csv"), at=folder, says=["log.csv: ", *says])


def test_an_axis_of_another_kind_is_refused(recorded: Columns, folder: Path) -> None:
    write(folder / "log.h5", recorded)
    rotary = yaml.safe_load(CONFIG)["stage"] | {"axis": "rotary"}
    with h5py.File(folder / "log.h5", "r+") as file:
        file.attrs["stage"] = json.dumps({"stage": rotary})
    refused(*diagnose("log.h5"), at=folder, says=["recorded on a rotary axis, the stage is linear"])


def test_recordings_that_do_not_go_together_are_refused(recorded: Columns, folder: Path) -> None:
    write(folder / "a.csv", recorded)
    write(folder / "b.csv", {k: v[::2] for k, v in recorded.items()})
    refused(*diagnose("a.csv", "b.csv"), at=folder, says=["a.csv has 1000 Hz, b.csv 500 Hz", "--rate"])
    refused(*diagnose("a.csv", "a.csv"), at=folder, says=["holds the same rows as a.csv"])
    refused(*diagnose("a.csv", "c.csv"), at=folder, says=["c.csv: there is no such file"])


@pytest.mark.parametrize(("before", "after", "says"), [
    ("mass: 2.0", "mass: 1.0e-9", "cannot be simulated in reasonable time"),
    ("mass: 2.0", "mass: -2.0", "mass"),
    ("mass: 2.0", "mas: 2.0", "did you mean stage.mass"),
    ("reach: 4.0e-6", "reach: .nan", "reach"),
])  # fmt: skip
def test_an_unusable_stage_is_refused(
    recorded: Columns, folder: Path, before: str, after: str, says: str
) -> None:
    write(folder / "log.csv", recorded)
    (folder / "other.yaml").write_text(CONFIG.replace(before, after))
    refused(*diagnose("log.csv", stage="other.yaml"), at=folder, says=[says])


@pytest.mark.parametrize("arguments", [
    ["diagnose", "--stage", "stage.yaml"],
    ["diagnose", "log.csv"],
    ["diagnose", "log.csv", "--stage", "stage.yaml", "--rate", "-1"],
    ["diagnose", "log.csv", "--stage", "stage.yaml", "--map", "position"],
])  # fmt: skip
def test_options_that_make_no_sense_are_refused(
    recorded: Columns, folder: Path, arguments: list[str]
) -> None:
    write(folder / "log.csv", recorded)
    refused(*arguments, at=folder)


def test_results_that_stand_there_are_not_overwritten_unasked(recorded: Columns, folder: Path) -> None:
    write(folder / "log.csv", recorded)
    before = listing(folder)
    line = refused("diagnose", "log.csv", "--stage", "stage.yaml", "--out", "out", at=folder)
    assert "--force" in line and listing(folder) == before


def dropped(c: Columns) -> Columns:
    gone = np.sort(np.random.default_rng(1).choice(len(c["time"]) - 2, 200, replace=False)) + 1
    return {k: np.delete(v, gone) for k, v in c.items()}


def shaken(c: Columns) -> Columns:
    return {**c, "time": c["time"] + 5e-5 * np.random.default_rng(1).uniform(size=len(c["time"]))}


DOUBTFUL: list[tuple[str, Callable[[Columns], Columns], list[str]]] = [
    ("a gap", lambda c: {k: np.delete(v, slice(1500, 1800)) for k, v in c.items()},
     ["1 gap, longest 0.301 s", "300 rows bridged"]),
    ("rows twice", lambda c: {k: np.repeat(v, 2) for k, v in c.items()}, ["of a time already seen"]),
    ("rows missing", dropped, ["resampled from uneven rows"]),
    ("jitter", shaken, ["time stamps jitter by"]),
]  # fmt: skip


@pytest.mark.parametrize(("change", "says"), [d[1:] for d in DOUBTFUL], ids=[d[0] for d in DOUBTFUL])
def test_doubtful_rows_are_said_and_not_taken_for_physics(
    recorded: Columns, folder: Path, change: Callable[[Columns], Columns], says: list[str]
) -> None:
    write(folder / "log.csv", change(dict(recorded)))
    run = rtcomp(*diagnose("log.csv"), at=folder)
    assert (run.returncode, run.stderr) == (0, "")
    answer = json.loads(run.stdout)
    assert answer["verdict"] == "consistent"
    notes = " ".join(answer["notes"])
    assert all(words in notes for words in says), notes


def test_what_could_not_be_seen_is_said(recorded: Columns, folder: Path) -> None:
    write(folder / "log.csv", recorded)
    run = rtcomp("diagnose", "log.csv", "--stage", "stage.yaml", "--out", "out", "--force", at=folder)
    assert run.returncode == 0, run.stderr
    answer = json.loads((folder / "out" / "diagnosis.json").read_text())
    seen = {size["name"]: size for size in answer["smallest_seen"]}
    assert "back-emf" in answer["not_observable"] and not set(seen) & set(answer["not_observable"])
    assert seen["cogging"]["parameter"] == "amplitude" and 0.0 < seen["cogging"]["value"] < 0.5
    text = " ".join(run.stdout.split())
    assert "in this motion:" in text and "back-emf" in text and "cogging amplitude" in text
    assert "What could not be seen in this recording" in (folder / "out" / "report.html").read_text()
