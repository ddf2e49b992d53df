"""Exchanges of `serial` on real ptys: limits, samples missing, late or twice, lines that are bad."""

from __future__ import annotations

import random
import time

import pytest
from rtcomp_drivers.board import Board
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.protocol import DISARMED
from serial_on_a_port import serial

from rtcomp.errors import DeviceError, DeviceTimeoutError, LimitError
from rtcomp.loop.device import INVALID, OK, STALE


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
        if noise.random() < 0.02:
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
