"""`rtcomp hil`: both jobs and faults over real links against plants in processes of their own."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from command import CONFIG, refused, rtcomp

from rtcomp.errors import ConfigError
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.hil import LEAST_KEPT, difference
from rtcomp.jobs.hil_device import device_on
from rtcomp.jobs.hil_faults import FAULTS, faults_named, jump_size

WATCHDOG_S = 0.5
"""In the quick tests, on a machine that may be busy with anything."""
LINKS = ("serial", "odrive-can", "cia402")


def verdicts(text: str) -> dict[tuple[str, str], dict[str, object]]:
    return {(v["link"], v["what"]): v for v in json.loads(text)["verdicts"]}


@pytest.mark.slow
@pytest.mark.realtime
def test_serial_from_end_to_end(tmp_path: Path) -> None:
    run = rtcomp(
        "hil", shipped("leuven.yaml"), "--link", "serial", "--seconds", "3", "--fault", "kill",
        "--watchdog", WATCHDOG_S, "--at-least", "2", "--out", "hil", "--json", at=tmp_path,
    )  # fmt: skip
    assert run.returncode in (0, 1) and run.stderr == "", run.stdout
    summary = json.loads(run.stdout)
    told, seen = summary["links"]["serial"], verdicts(run.stdout)
    assert summary["holds"] is (run.returncode == 0) is all(v["good"] for v in seen.values())
    bad = {what for (_, what), v in seen.items() if not v["good"]}
    # A machine that kept no deadline in three attempts leaves nothing to judge; else it must hold.
    assert bad <= ({"tracking error smaller by"} if told["improvement_over"] < LEAST_KEPT else set()), (
        run.stdout
    )
    assert told["ticks"] == 9000
    assert list(seen) == [
        ("serial", "tracking error smaller by"),
        ("serial", "slots and samples missed"),
        ("serial", "kill: zero at the plant, after the last command"),
        ("serial", "kill: a new host, nothing cleared"),
        ("serial", "kill: moved by arming again"),
    ]
    zeroed = seen["serial", "kill: zero at the plant, after the last command"]["seen"]
    assert str(zeroed).endswith(" ms, watchdog")
    assert float(str(zeroed).split()[0]) == pytest.approx(1e3 * WATCHDOG_S, abs=3.0)
    assert {p.name for p in (tmp_path / "hil" / "serial").iterdir()} == {
        "recording.h5", "without.h5", "with.h5",
    }  # fmt: skip
    assert json.loads((tmp_path / "hil" / "summary.json").read_text()) == summary


def test_a_verdict_that_does_not_hold_is_status_1(tmp_path: Path) -> None:
    """A factor that no compensation reaches; the table says which verdict it is, and nothing else is bad."""
    (tmp_path / "stage.yaml").write_text(CONFIG)
    run = rtcomp(
        "hil", "stage.yaml", "--link", "serial", "--seconds", "1.5", "--fault", "none", "--at-least", "9999",
        at=tmp_path,
    )  # fmt: skip
    assert (run.returncode, run.stderr) == (1, ""), run.stdout
    assert "1 of 2 verdicts do not hold" in " ".join(run.stdout.split())
    assert run.stdout.count("BAD") == 1


@pytest.mark.slow
@pytest.mark.realtime
def test_the_three_links_and_every_fault(tmp_path: Path) -> None:
    """At 1 kHz, 10 s a run: twenty times less error, one model, every fault's reaction."""
    run = rtcomp(
        "hil", shipped("leuven.yaml"), "--fault", "all", "--seconds", "10", "--watchdog", "0.2", "--json",
        at=tmp_path, timeout=1800.0,
    )  # fmt: skip
    assert run.returncode in (0, 1), run.stderr
    seen = verdicts(run.stdout)
    links = json.loads(run.stdout)["links"]
    starved = {link for link in LINKS if links[link]["improvement_over"] < LEAST_KEPT}
    bad = [key for key, v in seen.items() if not v["good"]]
    # A machine that kept no deadline in three attempts leaves nothing to judge; else it must hold.
    assert [key for key in bad if key[0] not in starved or key[1] != "tracking error smaller by"] == []
    assert {link for link, _ in seen} == set(LINKS)
    for link in LINKS:
        told = {what.split(":")[0] for who, what in seen if who == link and ":" in what}
        assert told == set(FAULTS)
        assert (link == LINKS[0]) != ((link, "model as over serial") in seen)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["missing.yaml"], ["missing.yaml", "no such file"]),
        (["stage.yaml", "--link", "usb"], ["'usb'", "'serial', 'odrive-can', 'cia402'"]),
        (["stage.yaml", "--fault", "fire"], ["'fire'", "kill"]),
        (["stage.yaml", "--fault", "none", "--fault", "kill"], ["--fault none"]),
        (["stage.yaml", "--seconds", "nan"], ["nan"]),
        (["stage.yaml", "--watchdog", "60"], ["60", "5"]),
        (["learns_nothing.yaml"], ["section identify is missing"]),
        (["stands.yaml"], ["section reference is missing"]),
        (["smooth.yaml"], ["smooth.yaml", "stage.friction is missing", "--plant"]),
        (["free.yaml", "--fault", "jump"], ["limits.jump"]),
        (["stage.yaml", "--plant", "missing.yaml"], ["missing.yaml"]),
        (["stage.yaml", "--out", "taken"], ["taken exists"]),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)  # fmt: skip
def test_bad_input_starts_nothing(tmp_path: Path, arguments: list[str], says: list[str]) -> None:
    (tmp_path / "stage.yaml").write_text(CONFIG)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "recording.h5").write_bytes(b"of an earlier run")
    without = CONFIG.split("\nidentify:")[0]
    (tmp_path / "learns_nothing.yaml").write_text(without)
    (tmp_path / "stands.yaml").write_text(CONFIG.replace("\nreference:", "\n# reference:"))
    smooth = CONFIG.split("  friction:")[0] + CONFIG[CONFIG.index("sensor:") :]
    (tmp_path / "smooth.yaml").write_text(smooth)
    free = CONFIG.replace("limits: {age: 10.0, travel: [-1.0e-3, 1.0e-3], speed: 0.05}\n", "")
    (tmp_path / "free.yaml").write_text(free)
    refused("hil", *arguments, at=tmp_path, says=says)


def test_a_link_that_there_is_not() -> None:
    with pytest.raises(ConfigError, match=r"'odrive'.*did you mean 'odrive-can'"):
        device_on("odrive", "/dev/pts/0", 0.1, "linear")


def test_which_faults_are_asked_for() -> None:
    assert faults_named(("all",)) == list(FAULTS)
    assert faults_named(("none",)) == []
    assert faults_named(("nan", "kill", "nan")) == ["nan", "kill"]


def test_a_jump_is_beyond_the_narrowest_limit() -> None:
    config = Configuration.load(shipped("leuven.yaml"))  # 0.05 m/s at 1 kHz, of which ten times are allowed
    assert jump_size(config) == pytest.approx(2 * 10 * 0.05 * 1e-3)
    narrow = config.changed(limits={**config.file.data["limits"], "jump": 1e-5})
    assert 1e-5 < jump_size(narrow) < 1e-4


def test_models_differ_by_the_largest_gap_over_the_largest_force() -> None:
    basis = IntervalBasis([2e-5, 4e-5])
    one, other = HysteresisModel(basis, np.array([1e5, 5e4])), HysteresisModel(basis, np.array([1e5, 6e4]))
    assert difference(one, one) == 0.0
    assert difference(one, other) == pytest.approx(0.2 / 2.0)  # 2e-5 m of half width, 1e4 N/m more; 1 + 1 N
    assert math.isclose(difference(other, one), 0.2 / 2.2)
