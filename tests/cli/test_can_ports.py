"""CAN interfaces as a user names and misnames them: one line, exit status 2, nothing written."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
from command import one_error_line, rtcomp

from rtcomp.cli.runs import load

CONFIG = Path(__file__).resolve().parents[2] / "configs" / "odrive_can.yaml"


def has_can() -> bool:
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except (AttributeError, OSError):
        return False
    return True


def refused(folder: Path, *arguments: str, change: tuple[str, str] = ("", "")) -> str:
    text = CONFIG.read_text()
    assert change[0] in text
    (folder / "run.yaml").write_text(text.replace(*change) if change[0] else text)
    run = rtcomp("identify", "run.yaml", *arguments, "--out", "results", at=folder)
    assert not (folder / "results").exists()
    return one_error_line(run)


def test_the_port_of_the_command_line_is_a_can_driver_s_channel() -> None:
    device = load(CONFIG, port="/dev/ttyACM9").run.device
    assert (device["interface"], device["channel"]) == ("slcan", "/dev/ttyACM9")
    assert device["lead"] == 1e-3
    device = load(CONFIG, port="can7").run.device
    assert (device["interface"], device["channel"]) == ("socketcan", "can7")
    board = CONFIG.with_name("serial_board.yaml")
    assert load(board, port="/dev/ttyS9").run.device["watchdog"] == 0.05
    stage = CONFIG.with_name("leuven.yaml")
    assert load(stage, port="/dev/ttyS9").run.device == {"driver": "serial", "port": "/dev/ttyS9"}


def test_ports_that_are_none(tmp_path: Path) -> None:
    assert "does not exist" in refused(tmp_path, "--port", "/dev/ttyNone")
    assert "not a serial port" in refused(tmp_path, "--port", "/dev/null")


@pytest.mark.skipif(has_can(), reason="this kernel has CAN sockets")
def test_a_kernel_without_can_sockets(tmp_path: Path) -> None:
    said = refused(tmp_path)
    assert "AF_CAN" in said
    assert "slcan" in said


@pytest.mark.skipif(not has_can(), reason="this kernel has no CAN sockets (AF_CAN)")
def test_an_interface_that_there_is_not(tmp_path: Path) -> None:
    assert "can83 does not exist" in refused(tmp_path, "--port", "can83")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("bitrate: 1000000", "bitrate: 250000"), ["device.bitrate", "131 %", "500000", "611 Hz"]),
        (("interface: socketcan", "interface: sokcetcan"), ["device.interface", "did you mean 'socketcan'"]),
        (("  lead: 1.0e-3", "  # none"), ["device.lead", "is missing"]),
        (("node_id: 0", "node_id: 64"), ["device.node_id", "64", "[0, 62]"]),
        (("watchdog: 0.1 ", "watchdog: 0.0015 "), ["device.watchdog", "0.0015"]),
        (("  bitrate:", "  baud:"), ["device.baud", "baudrate"]),
    ],
)
def test_settings_that_do_not_fit_name_their_line(
    tmp_path: Path, change: tuple[str, str], words: list[str]
) -> None:
    said = refused(tmp_path, change=change)
    assert "run.yaml:" in said
    for word in words:
        assert word in said
