"""Faults on purpose: every row of the table, drawn variants each, as the plant's side saw them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import fault_rows
import fault_run
import pytest
from fault_rows import ROWS, Row
from fault_run import variant
from rtcomp_drivers.faults import KINDS, Fault, FaultyDevice

from rtcomp.jobs.configuration import Configuration
from rtcomp.loop.device import Device

BY_NAME = {row.name: row for row in ROWS}
MANY = pytest.param(range(100), marks=pytest.mark.slow, id="100")


@pytest.mark.parametrize("seeds", [pytest.param(range(1000, 1010), id="10"), MANY])
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_every_fault_has_its_reaction_every_time(row: Row, seeds: range) -> None:
    problems = [problem for seed in seeds for problem in variant(row, seed).problems]
    assert problems == []


@pytest.mark.parametrize(
    ("name", "off"),
    [
        ("index slip", {"jump": 1e3}),
        ("stuck while driven", {"stuck": 1e3}),
        ("no reply, longer", {"age": 1e3}),
        ("frozen", {"age": 0.003}),
        ("beam lost", {"invalid": 1e3, "age": 1e3}),
    ],
)
def test_the_table_sees_a_check_that_is_missing(
    name: str, off: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With one limit taken away, or another in its place, the same variants fail."""
    config: Configuration = fault_run.CONFIG
    limits = {**config.file.data["limits"], **off}
    monkeypatch.setattr(fault_run, "CONFIG", config.changed(limits=limits))
    assert any(variant(BY_NAME[name], seed).problems for seed in range(1000, 1010))


def test_every_kind_of_fault_is_in_the_table() -> None:
    source = Path(fault_rows.__file__).read_text()
    assert [kind for kind in KINDS if f'"{kind}"' not in source] == []


def test_what_is_no_fault_is_refused() -> None:
    with pytest.raises(ValueError, match="no kind of fault is named 'gremlin'; known are no reply"):
        Fault("gremlin", 3)


def test_a_device_that_goes_wrong_is_a_device() -> None:
    class Inner:
        delay_ticks = 1

        def open(self) -> None: ...

        def exchange(self, volts: float) -> None: ...

        def close(self) -> None: ...

    device = FaultyDevice(Inner(), [])  # type: ignore[arg-type]
    assert isinstance(device, Device) and device.delay_ticks == 1


def test_the_table_is_printed_and_written(tmp_path: Path) -> None:
    tool = Path(fault_rows.__file__).with_name("bench_faults.py")
    command = [sys.executable, str(tool), "--variants", "1", "--json", str(tmp_path / "faults.json")]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    figures = json.loads((tmp_path / "faults.json").read_text())["faults"]
    assert [f["fault"] for f in figures] == list(BY_NAME)
    assert all(f["as_required"] == f["variants"] == 1 for f in figures)
    assert all(row.name in run.stdout for row in ROWS)
