"""The driver `serial` on real ptys: ports that are none, boards that do not fit, lines that are bad."""

from __future__ import annotations

import os
import random
import select
import subprocess
import sys
import threading
import time
import tty

import pytest
from rtcomp_drivers import protocol
from rtcomp_drivers.board import Board
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.protocol import ARMED, DISARMED, FAULT
from rtcomp_drivers.registry import create

from rtcomp.errors import (
    ConfigError,
    DeviceBusyError,
    DeviceError,
    DeviceTimeoutError,
    LimitError,
    ProtocolError,
)
from rtcomp.loop.device import INVALID, OK, STALE

BENCH = Bench(period=1e-3)


def serial(port, bench=BENCH, **settings):
    settings = {"reply_timeout": 0.2, "connect_timeout": 2.0, **settings}
    return create({"driver": "serial", "port": str(port), **settings}, bench)


def refused(error_type, port, *words, bench=BENCH, **settings):
    """Opening fails with one line that names the port and holds the words."""
    with pytest.raises(error_type) as caught:
        serial(port, bench, **settings).open()
    assert type(caught.value) is error_type
    message = str(caught.value)
    assert "\n" not in message
    for word in (str(port), *words):
        assert word in message
    return message


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
    script = (
        "import serial, sys; p = serial.Serial(sys.argv[1], exclusive=True);"
        "print('held', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, board.port], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as holder:
        assert holder.stdout.readline() == b"held\n"
        refused(DeviceBusyError, board.port, "busy")
        holder.stdin.close()
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


def test_the_output_is_what_was_commanded_a_tick_before(pty_board):
    board = pty_board(voltage_limit=2.0)
    with serial(board.port) as device:
        outputs = []
        for volts in (0.5, -1.25, 99.0, 0.0):
            device.exchange(volts)
            outputs.append(device.output)
        assert outputs == [0.0, 0.5, -1.25, 2.0]
        assert device.counters["clamped"] == 1
    assert device.disarmed is True
    assert board.board.state == DISARMED
    assert board.board.output == 0.0


def test_the_stage_s_limit_goes_to_the_board(pty_board, stage):
    board = pty_board(voltage_limit=100.0)
    with serial(board.port, bench=Bench(stage=stage)) as device:
        device.exchange(50.0)
        device.exchange(0.0)
        assert device.output == stage.voltage_limit
    with serial(board.port, voltage_limit=3.0, bench=Bench(stage=stage)) as device:
        device.exchange(50.0)
        device.exchange(0.0)
        assert device.output == 3.0


def test_a_command_that_no_board_can_take_is_not_sent(pty_board):
    board = pty_board()
    with serial(board.port) as device:
        device.exchange(1.0)
        before = board.board.decoder.good
        for volts in (float("nan"), float("inf"), -float("inf"), 3000.0, -3000.0):
            with pytest.raises(LimitError):
                device.exchange(volts)
        device.exchange(1.0)
        assert board.board.decoder.good == before + 1


def test_a_missing_sample_is_the_last_one_again_and_too_many_are_an_error(pty_board):
    board = pty_board()
    with serial(board.port, reply_timeout=0.05, max_missed=3, watchdog=1.0) as device:
        good = device.exchange(0.0)
        board.to_host = lambda _: b""
        for _ in range(3):
            assert device.exchange(0.0) == good._replace(status=STALE)
        with pytest.raises(DeviceTimeoutError, match="4 exchanges in a row"):
            device.exchange(0.0)
        board.to_host = lambda data: data
    assert device.counters["missed"] == 4


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


def test_after_the_watchdogs_time_without_a_sample_it_ends(pty_board):
    board = pty_board()
    with serial(board.port, reply_timeout=0.05, watchdog=0.4) as device:
        device.exchange(0.0)
        board.to_host = lambda _: b""
        silent = time.monotonic()
        with pytest.raises(DeviceTimeoutError, match="9 exchanges in a row"):
            for _ in range(100):
                device.exchange(0.0)
        assert time.monotonic() - silent >= 0.4
        board.to_host = lambda data: data


def test_after_a_pause_of_the_line_samples_are_fresh_again(pty_board):
    board = pty_board()
    with serial(board.port, reply_timeout=0.05, watchdog=1.0) as device:
        device.exchange(0.0)
        board.to_board = lambda _: b""
        assert device.exchange(0.0).status == STALE
        board.to_board = lambda data: data
        fresh = device.exchange(0.0)
        assert fresh.status == OK
        assert (
            fresh.sequence == 4
        )  # of the first sample, taken when opening, of two exchanges, one lost, this


def test_a_late_sample_is_used_as_a_stale_one(pty_board):
    board = pty_board()
    held = []

    def late(data):  # each answer comes with the next
        held.append(data)
        return held.pop(0) if len(held) > 1 else b""

    with serial(board.port, reply_timeout=0.05, watchdog=1.0) as device:
        device.exchange(0.0)
        board.to_host = late
        samples = [device.exchange(1.0) for _ in range(10)]
        board.to_host = lambda data: b"".join([*held, data])
    assert all(s.status == STALE for s in samples)
    assert [s.sequence for s in samples] == [2, *range(3, 12)]
    assert device.counters["late"] == 9


def test_duplicates_and_replays_are_counted_and_change_nothing(pty_board):
    board = pty_board()
    history = []

    def replayed(data):
        history.append(data)
        return history[0] + data + data + history[-1]

    with serial(board.port) as device:
        board.to_host = replayed
        device.exchange(1.0)
        history.clear()
        samples = [device.exchange(1.0) for _ in range(30)]
        board.to_host = lambda data: data
    assert all(s.status == OK for s in samples)
    assert [s.sequence for s in samples] == list(range(3, 33))
    assert device.counters["duplicate"] >= 80


def test_commands_sent_twice_are_acted_on_once(pty_board):
    board = pty_board()
    with serial(board.port) as device:
        device.exchange(1.0)
        board.to_board = lambda data: data + data
        samples = [device.exchange(1.0) for _ in range(20)]
        board.to_board = lambda data: data
    assert [s.sequence for s in samples] == list(range(3, 23))
    assert board.board.counters["discarded"] == 20


def test_a_line_with_a_few_damaged_frames_is_ridden_out(pty_board):
    board = pty_board()
    noise = random.Random(5)

    def damage(data):
        damaged = bytearray(data)
        if noise.random() < 0.04:
            damaged[noise.randrange(len(damaged))] ^= 1 << noise.randrange(8)
        return bytes(damaged)

    with serial(board.port, reply_timeout=0.01, watchdog=1.0) as device:
        device.exchange(0.5)
        board.to_host = board.to_board = damage
        samples = [device.exchange(0.5) for _ in range(400)]
        board.to_host = board.to_board = lambda data: data
    sequences = [s.sequence for s in samples if s.status == OK]
    assert sequences == sorted(set(sequences))
    assert len(sequences) > 300
    assert device.counters["missed"] == 400 - len(sequences)
    assert device.counters["missed"] > 0


def test_a_line_with_many_damaged_frames_is_an_error(pty_board):
    board = pty_board()
    with serial(board.port, reply_timeout=0.01, watchdog=1.0) as device:
        device.exchange(0.5)
        board.to_host = lambda data: b"\x05\x05" + data
        with pytest.raises(DeviceError, match="damaged"):
            for _ in range(400):
                device.exchange(0.5)


def test_a_board_whose_clock_stands_gives_nothing_new(pty_board):
    board = pty_board()
    with serial(board.port, reply_timeout=0.05, max_missed=2, watchdog=1.0) as device:
        device.exchange(0.5)
        stands = time.monotonic()
        board.clock = lambda: stands
        time.sleep(0.01)
        device.exchange(0.5)
        assert device.exchange(0.5).status == STALE
        with pytest.raises(DeviceTimeoutError):
            for _ in range(3):
                device.exchange(0.5)
    assert device.counters["frozen"] >= 2


def test_a_position_that_is_invalid_says_so(pty_board):
    board = pty_board()
    board.board.plant.measure = lambda: float("nan")
    with serial(board.port) as device:
        assert device._last.status == INVALID
        with pytest.raises(DeviceError, match=r"sensor|not armed"):
            for _ in range(2):
                device.exchange(0.0)


def test_a_board_that_restarted_is_noticed(pty_board):
    board = pty_board()
    with serial(board.port) as device:
        device.exchange(0.5)
        board.board = Board(board.board.plant, board.board.facts)
        with pytest.raises(DeviceError, match="not armed any more but DISARMED"):
            device.exchange(0.5)


def test_an_unplugged_port_is_an_error_and_closing_it_is_not(pty_board):
    board = pty_board()
    device = serial(board.port)
    device.open()
    device.exchange(0.5)
    board.unplug()
    with pytest.raises(DeviceError, match="has gone"):
        for _ in range(3):
            device.exchange(0.5)
    device.close()
    device.close()
    assert device.disarmed is False
    assert any("not confirmed" in r for r in device.remarks)


def test_closing_does_not_wait_for_a_board_that_is_silent(pty_board):
    board = pty_board()
    device = serial(board.port)
    device.open()
    device.exchange(0.5)
    board.to_board = lambda _: b""
    began = time.monotonic()
    device.close()
    assert time.monotonic() - began < 2.0
    assert device.disarmed is False
    with pytest.raises(DeviceError, match="not open"):
        device.exchange(0.0)
