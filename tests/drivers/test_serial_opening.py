"""Opening `serial` on real ptys: ports that are none, other things at their end, boards that do not fit."""

from __future__ import annotations

import os
import random
import select
import threading
import time
import tty

import pytest
from held_port import held
from rtcomp_drivers import protocol
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.protocol import ARMED, FAULT
from rtcomp_drivers.registry import create
from serial_on_a_port import BENCH, refused, serial

from rtcomp.errors import (
    ConfigError,
    DeviceBusyError,
    DeviceError,
    DeviceTimeoutError,
    ProtocolError,
)
from rtcomp.loop.device import OK


class Peer:
    """Something else at the other end of a pty: answers each read with what `answer` makes of it."""

    def __init__(self, answer):
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._answer = answer
        self._ended = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._ended:
            if select.select([self._master], [], [], 0.01)[0]:
                data = self._answer(os.read(self._master, 4096))
                if data:
                    os.write(self._master, data)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._ended = True
        self._thread.join()
        os.close(self._master)
        os.close(self._slave)


def test_ports_that_are_none(tmp_path):
    file = tmp_path / "file"
    file.write_text("kept")
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    refused(DeviceError, tmp_path / "ttyNone", "does not exist")
    refused(DeviceError, file, "a regular file, not a serial port")
    refused(DeviceError, tmp_path, "a directory, not a serial port")
    refused(DeviceError, fifo, "a pipe, not a serial port")
    refused(DeviceError, "/dev/null", "not a serial port")
    refused(DeviceError, "no\nsuch\0port".replace("\n", ""), "cannot be opened")
    assert file.read_text() == "kept"


def test_a_port_that_another_process_holds(pty_board):
    board = pty_board()
    with held(board.port):
        refused(DeviceBusyError, board.port, "busy")
    with serial(board.port):
        refused(DeviceBusyError, board.port, "busy")
    with serial(board.port) as again:
        assert again.info is not None


def test_a_port_where_nobody_answers():
    with Peer(lambda _: b"") as peer:
        began = time.monotonic()
        refused(DeviceTimeoutError, peer.port, "0.3 s", "powered", connect_timeout=0.3)
        assert 0.3 <= time.monotonic() - began < 2.0


def test_a_port_that_belongs_to_something_else():
    chatter = random.Random(1)
    with Peer(lambda _: chatter.randbytes(200)) as peer:
        refused(ProtocolError, peer.port, "something else", connect_timeout=0.3)
    with Peer(lambda _: b"$GPGGA,123519,4807.038,N*47\r\n") as peer:
        refused(ProtocolError, peer.port, "something else", connect_timeout=0.3)
    with Peer(lambda data: data) as peer:
        refused(ProtocolError, peer.port, "sends back")


def test_a_board_of_another_version():
    def answer(data):
        hellos = protocol.Decoder().feed(data)
        return b"".join(protocol.encode(protocol.OtherVersion(m.tag, 2)) + b"" for m in hellos)

    with Peer(answer) as peer:
        refused(ProtocolError, peer.port, "version 2", "update")


def test_a_board_that_answers_late_in_its_life_is_waited_for(pty_board):
    """As one that resets when its port is opened."""
    board = pty_board()
    since = time.monotonic() + 0.35
    board.to_board = lambda data: data if time.monotonic() > since else b""
    with serial(board.port) as device:
        assert device.exchange(0.0).status == OK


def test_boards_that_do_not_fit(pty_board, stage):
    refused(DeviceError, pty_board(axis="rotary").port, "rotary", bench=Bench(stage=stage))
    refused(DeviceError, pty_board(max_rate_hz=500).port, "500 Hz", "1000 Hz")
    refused(ProtocolError, pty_board(count_size=0.0).port, "count")
    armed = pty_board()
    armed.board.state = ARMED
    armed.board._watchdog = armed.board._fed = 1e9
    refused(DeviceBusyError, armed.port, "another host")


def test_settings_that_make_no_sense():
    with pytest.raises(ConfigError, match="watchdog"):
        create({"driver": "serial", "port": "x", "watchdog": 0.05}, Bench(period=0.1))
    with pytest.raises(ConfigError, match=r"baudrte.*baudrate"):
        create({"driver": "serial", "port": "x", "baudrte": 1}, BENCH)
    with pytest.raises(ConfigError, match=r"port.*missing"):
        create({"driver": "serial"}, BENCH)
    with pytest.raises(ConfigError, match=r"watchdog.*\[0.002, 10\]"):
        create({"driver": "serial", "port": "x", "watchdog": 11.0}, BENCH)


def test_a_latched_fault_is_cleared_only_when_asked(pty_board):
    board = pty_board()
    with serial(board.port, watchdog=0.01) as device:
        device.exchange(1.0)
        time.sleep(0.05)
        with pytest.raises(DeviceError, match=r"FAULT|not armed"):
            device.exchange(1.0)
    refused(DeviceError, board.port, "FAULT", "watchdog", "clear_fault")
    assert board.board.state == FAULT
    with serial(board.port, clear_fault=True) as device:
        assert any("cleared" in r for r in device.remarks)
        assert device.exchange(0.0).status == OK


@pytest.mark.parametrize(
    ("period", "settings", "most"),
    [
        (1e-3, {}, 100),
        (1e-4, {}, 1000),
        (0.02, {}, 5),
        (0.05, {}, 2),
        (1e-3, {"watchdog": 1.0}, 1000),
        (1e-3, {"watchdog": 1.0, "reply_timeout": 0.05}, 20),
        (1e-3, {"max_missed": 7}, 7),
        (1e-3, {"max_missed": 0}, 0),
    ],
)
def test_samples_may_be_missing_for_the_watchdogs_time(period, settings, most):
    device = create({"driver": "serial", "port": "/dev/null", **settings}, Bench(period=period))
    assert device.max_missed == most
