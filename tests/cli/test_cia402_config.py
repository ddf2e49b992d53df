"""The ready configuration of a CiA 402 drive, and what a user gets wrong in it: one line, exit status 2."""

from __future__ import annotations

from pathlib import Path

import pytest
from command import one_error_line, rtcomp

from rtcomp.cli.runs import load

CONFIG = Path(__file__).resolve().parents[2] / "configs" / "cia402.yaml"


def refused(folder: Path, *arguments: str, change: tuple[str, str] | None = None) -> str:
    text = CONFIG.read_text()
    if change is not None:
        assert change[0] in text
        text = text.replace(*change)
    (folder / "run.yaml").write_text(text)
    run = rtcomp("identify", "run.yaml", *arguments, "--out", "results", at=folder)
    assert not (folder / "results").exists()
    return one_error_line(run)


def test_it_is_ready_for_an_adapter_and_for_the_kernels_interface() -> None:
    device = load(CONFIG, port="/dev/pts/7").run.device
    assert (device["driver"], device["interface"], device["channel"]) == ("cia402", "slcan", "/dev/pts/7")
    assert load(CONFIG, port="can0").run.device["channel"] == "can0"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("bitrate: 1000000 ", "bitrate: 250000 "), ["run.yaml:", "device.bitrate", "500000"]),
        (
            ("# eds: my-drive.eds", "eds: my-drive.eds"),
            ["run.yaml:", "device.eds", "my-drive.eds does not exist"],
        ),
        (("node: 5 ", "node: 200 "), ["run.yaml:", "device.node"]),
        (("node: 5 ", "nodes: 5 "), ["run.yaml:", "nodes"]),
        (("watchdog: 0.1 ", "watchdog: 0.001 "), ["run.yaml:", "device.watchdog"]),
        (("node: 5 ", "host_node: 5\n  node: 5 "), ["run.yaml:", "device.host_node", "own node"]),
    ],
)
def test_what_cannot_be_is_named_with_its_line(
    tmp_path: Path, change: tuple[str, str], words: list[str]
) -> None:
    said = refused(tmp_path, "--port", "/dev/ttyNone", change=change)
    assert all(word in said for word in words), said


def test_a_port_that_there_is_not(tmp_path: Path) -> None:
    assert "/dev/ttyNone does not exist" in refused(tmp_path, "--port", "/dev/ttyNone")
    assert "not a serial port" in refused(tmp_path, "--port", "/dev/null")
