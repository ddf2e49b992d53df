"""Exchanges of `odrive-can` on real ptys: units, limits, replies that are missing, late, twice or cut."""

from __future__ import annotations

import itertools
import math
import time

import pytest
from odrive_on_a_port import command, odrive
from rtcomp_drivers import cansimple as c
from rtcomp_drivers.cansimple import CLOSED_LOOP, IDLE, Command
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.slcan import Frame
from waiting import wait

from rtcomp.errors import DeviceTimeoutError, LimitError
from rtcomp.loop.device import INVALID, OK, STALE


def test_frames_of_other_nodes_change_nothing(axis):
    others = [command(k, bytes(8), node=4) for k in range(32)] + [Frame(0x1ABCDE, b"\1", False, True)]
    with odrive(axis.port) as device:
        for _ in range(10):
            axis.inject(*others)
            assert device.exchange(0.1).status == OK


def test_until_the_first_exchange_nothing_is_armed_and_arming_moves_nothing(axis):
    axis.axis.input_torque = 0.7  # what a host before us left behind
    with odrive(axis.port) as device:
        assert axis.axis.state == IDLE
        device.arm()
        wait(lambda: axis.axis.state == CLOSED_LOOP)
        assert axis.axis.torque == 0.0
        assert axis.axis.plant.position == 0.0
    assert axis.axis.state == IDLE
    assert device.disarmed is True


def test_torque_position_and_their_units(axis):
    turn = 0.005
    with odrive(axis.port, lead=turn, torque_per_volt=0.25) as device:
        outputs = []
        for volts in (0.5, -1.25, 2.0, 0.0):
            device.exchange(volts)
            outputs.append(device.output)
            wait(lambda v=volts: axis.axis.torque == pytest.approx(0.25 * v))
        assert outputs == [0.0, 0.5, -1.25, 2.0]
        axis.axis.plant.position = 2.0 * math.pi * 3.0  # three turns of the motor
        axis.axis.plant.velocity = 0.0
        assert device.exchange(0.0).position == pytest.approx(3.0 * turn, rel=1e-5)


def test_limits_go_where_they_belong(axis, stage):
    bench = Bench(stage=stage)
    with odrive(axis.port, bench, lead=0.001, velocity_limit=20.0, current_limit=8.0) as device:
        assert device.torque_per_volt == pytest.approx(stage.force_constant * 0.001 / (2 * math.pi))
        device.exchange(1e4)
        device.exchange(0.0)
        assert device.output == pytest.approx(stage.voltage_limit)
        assert device.counters["clamped"] == 1
        assert axis.axis.limits == (20.0, 8.0)
    with odrive(axis.port, torque_limit=0.1) as device:
        device.exchange(-5.0)
        wait(lambda: axis.axis.torque == pytest.approx(-0.1))


@pytest.mark.parametrize("volts", [math.nan, math.inf, -math.inf, 1e9])
def test_a_command_that_is_no_torque_is_not_sent(axis, volts):
    with odrive(axis.port) as device:
        device.exchange(0.1)
        with pytest.raises(LimitError):
            device.exchange(volts)
        device.exchange(0.2)
        wait(lambda: axis.axis.counters["commands"] == 3)
        time.sleep(0.05)
        assert axis.axis.counters["commands"] == 3  # the zero of arming, and two
        assert axis.axis.torque == pytest.approx(0.2)


def test_a_missing_reply_is_the_last_one_again_and_too_many_are_an_error(axis):
    with odrive(axis.port, reply_timeout=0.02, max_missed=3) as device:
        good = device.exchange(0.0)
        axis.to_host = lambda frames: [f for f in frames if f.identifier & 31 == Command.HEARTBEAT]
        for _ in range(3):
            assert device.exchange(0.0) == good._replace(status=STALE)
        with pytest.raises(DeviceTimeoutError, match="4 exchanges in a row"):
            device.exchange(0.0)
        axis.to_host = lambda frames: frames
    assert device.counters["missed"] == 4


def test_a_reply_that_comes_with_the_next_is_counted_and_in_order(axis):
    held = []

    def late(frames):
        replies = [f for f in frames if f.identifier & 31 == Command.ENCODER_ESTIMATES]
        if not replies:
            return frames
        held.extend(replies)
        return [held.pop(0)] if len(held) > 1 else []

    with odrive(axis.port, reply_timeout=0.05) as device:
        first = device.exchange(0.0)
        axis.to_host = late
        samples = [device.exchange(0.5) for _ in range(10)]
        axis.to_host = lambda frames: frames
        time.sleep(0.02)
        last = device.exchange(0.0)
    assert samples[0].status == STALE
    assert last.status == OK
    sequences = [s.sequence for s in (first, *samples, last)]
    assert sequences == sorted(sequences)


def test_replies_twice_are_late_ones_and_the_newest_counts(axis):
    axis.to_host = lambda frames: [f for f in frames for _ in (0, 1)]
    with odrive(axis.port) as device:
        samples = []
        for _ in range(20):
            samples.append(device.exchange(0.2))
            time.sleep(5e-3)
    assert all(s.status == OK for s in samples)
    assert all(b.position > a.position for a, b in itertools.pairwise(samples[2:]))
    assert device.counters["late"] >= 15


def test_a_position_that_stands_while_it_says_it_moves_is_stale(axis):
    stuck = c.encode_estimates(1.25, 3.0)

    def frozen(frames):
        return [
            f._replace(data=stuck) if f.identifier & 31 == Command.ENCODER_ESTIMATES else f for f in frames
        ]

    with odrive(axis.port, reply_timeout=0.02, max_missed=5) as device:
        axis.to_host = frozen
        assert device.exchange(0.0).status == OK
        assert device.exchange(0.0).status == STALE
        with pytest.raises(DeviceTimeoutError):
            for _ in range(6):
                device.exchange(0.0)
        axis.to_host = lambda frames: frames
    assert device.counters["frozen"] >= 6


def test_cut_frames_are_counted_and_never_a_position(axis):
    def cut(frames):
        return [f._replace(data=f.data[:4]) for f in frames]

    with odrive(axis.port, reply_timeout=0.02, max_missed=5) as device:
        good = device.exchange(0.0)
        axis.to_host = cut
        assert device.exchange(0.0) == good._replace(status=STALE)
        axis.to_host = lambda frames: frames
        assert device.exchange(0.0).status == OK
    assert device.counters["damaged"] >= 1


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_a_position_that_is_no_number_is_invalid(axis, number):
    with odrive(axis.port) as device:
        good = device.exchange(0.0)
        axis.axis.plant.measure = lambda: number
        sample = device.exchange(0.0)
        assert sample.status == INVALID
        assert sample.position == good.position
        axis.axis.plant.measure = lambda: 0.0
