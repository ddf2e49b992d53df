"""`rtcomp drivers` as a user runs it."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

RTCOMP = str(Path(sys.executable).parent / "rtcomp")


def drivers(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([RTCOMP, "drivers", *arguments], capture_output=True, text=True, timeout=60)


def test_every_installed_driver_is_listed_with_its_settings() -> None:
    run = drivers()
    assert (run.returncode, run.stderr) == (0, "")
    heads = [line for line in run.stdout.splitlines() if line and not line.startswith(" ")]
    assert heads == sorted(entry.name for entry in entry_points(group="rtcomp.drivers"))
    assert "port" in run.stdout and "(required)" in run.stdout
    assert max(map(len, run.stdout.splitlines())) <= 100


def test_one_driver_for_machines() -> None:
    (serial,) = json.loads(drivers("serial", "--json").stdout)
    assert serial["name"] == "serial" and serial["available"] is True
    port = next(setting for setting in serial["settings"] if setting["name"] == "port")
    assert port["required"] is True


def test_an_unknown_driver_is_one_line_with_the_nearest() -> None:
    run = drivers("serail")
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.count("\n") == 1
    assert "did you mean 'serial'?" in run.stderr
