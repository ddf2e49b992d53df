"""The driver `odrive-can` on real ptys: axes that do not fit, other masters, buses that are bad."""

from __future__ import annotations

import itertools
import math
import threading
import time

import pytest
from rtcomp_drivers import cansimple as c
from rtcomp_drivers.cansimple import CLOSED_LOOP, IDLE, Command
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.odrive_axis import OdriveAxis
from rtcomp_drivers.registry import create
from rtcomp_drivers.slcan import Frame

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
WATCHDOG = 1.0
"""s, on both sides in most tests: this machine may be busy."""


def odrive(port, bench=BENCH, **settings):
    settings = {
        "reply_timeout": 0.2,
        "watchdog": WATCHDOG,
        "check_watchdog": False,
        "connect_timeout": 2.0,
        "heartbeat_timeout": 2.0,
        **settings,
    }
    return create({"driver": "odrive-can", "interface": "slcan", "channel": str(port), **settings}, bench)


def refused(error_type, port, *words, bench=BENCH, **settings):
    """Opening fails with one line that holds the words; afterwards the port is free."""
    device = odrive(port, bench, **settings)
    with pytest.raises(error_type) as caught:
        device.open()
    assert type(caught.value) is error_type
    message = str(caught.value)
    assert "\n" not in message
    for word in (str(port), *words):
        assert word in message
    with pytest.raises(DeviceError, match=r"open\(\)"):
        device.exchange(0.0)
    return message


def command(what, data=b"", node=0):
    return Frame(c.identifier(node, what), data)


def comes(true, seconds=2.0):
    """Wait until something is true: a command leaves after the request whose answer was waited for."""
    end = time.monotonic() + seconds
    while not true() and time.monotonic() < end:
        time.sleep(2e-3)
    return true()


@pytest.fixture
def axis(pty_axis):
    return pty_axis(watchdog=WATCHDOG)


def test_ports_that_are_none(tmp_path):
    refused(DeviceError, tmp_path / "ttyNone", "does not exist")
    refused(DeviceError, "/dev/null", "not a serial port")


def test_a_port_that_is_in_use(axis):
    with odrive(axis.port):
        refused(DeviceBusyError, axis.port, "busy")
    with odrive(axis.port) as again:
        assert again.version.firmware == (0, 6, 10)


def test_nobody_there(adapter, pty_axis):
    refused(DeviceTimeoutError, adapter.port, "nothing at all was heard", "bit rate", connect_timeout=0.4)
    other = pty_axis(node=7)
    refused(DeviceTimeoutError, other.port, "node 3", "heard: 7", node_id=3, connect_timeout=0.6)
    with odrive(other.port, node_id=7) as device:
        assert device.exchange(0.0).status == OK


def test_a_bus_at_another_bit_rate(pty_axis):
    slow = pty_axis(bit_rate=500_000)
    refused(DeviceTimeoutError, slow.port, "bit rate is 1000000 there too", connect_timeout=0.4)


@pytest.mark.parametrize("bitrate", [250_000, 125_000])
def test_a_bit_rate_that_is_too_low_is_refused_before_anything_is_opened(bitrate):
    with pytest.raises(
        ConfigError, match=r"% of a bus at .*a bit rate of 500000 or a rate of at most \d+ Hz"
    ):
        odrive("/dev/ttyNone", bitrate=bitrate)
    assert odrive("/dev/ttyNone", Bench(period=0.01), bitrate=bitrate).bus_load < 0.4
    assert odrive("/dev/ttyNone").bus_load == pytest.approx(0.32635)
    with pytest.raises(ConfigError, match=r"325 %.*at most 2457 Hz"):
        odrive("/dev/ttyNone", Bench(period=1e-4))


def test_settings_that_make_no_sense(stage):
    with pytest.raises(ConfigError, match=r"device\.lead: is missing"):
        odrive("x", Bench(stage=stage))
    with pytest.raises(ConfigError, match="watchdog"):
        odrive("x", Bench(period=0.1), watchdog=0.05)
    with pytest.raises(ConfigError, match="give both"):
        odrive("x", velocity_limit=2.0)
    with pytest.raises(ConfigError, match=r"node_id.*\[0, 62\]"):
        odrive("x", node_id=63)
    with pytest.raises(ConfigError, match="firmware"):
        odrive("x", firmware="0.4")
    with pytest.raises(ConfigError, match="channel"):
        create({"driver": "odrive-can", "interface": "slcan"}, BENCH)
    with pytest.raises(ConfigError, match="sclan"):
        odrive("x", interface="sclan")


def test_firmware_that_is_another(pty_axis):
    refused(ProtocolError, pty_axis(firmware=(0, 7, 1)).port, "0.7.1", "0.6")
    old = pty_axis(dialect="0.5.6", watchdog=None)
    refused(ProtocolError, old.port, "does not say its version", "0.5.6")
    with odrive(old.port, firmware="0.5.6") as device:
        assert device.version is None
        for _ in range(5):
            assert device.exchange(0.1).status == OK
        assert comes(lambda: old.axis.torque == pytest.approx(0.1))
    assert device.disarmed is True


def test_the_usual_error_of_0_5_6_is_cleared_and_others_are_not(pty_axis):
    old = pty_axis(dialect="0.5.6", watchdog=0.2)
    time.sleep(0.3)
    assert old.axis.error
    with odrive(old.port, firmware="0.5.6", watchdog=0.2) as device:
        assert not any("cleared" in r for r in device.remarks)
        device.exchange(0.0)
    old.axis.error |= c.error_bit("MOTOR_FAILED", "0.5.6")
    refused(DeviceError, old.port, "MOTOR_FAILED", "clear_fault", firmware="0.5.6")


def test_an_axis_that_somebody_else_has(axis):
    axis.axis.mode = (c.TORQUE_CONTROL, c.PASSTHROUGH)
    axis.axis.state = CLOSED_LOOP
    feeding = threading.Event()

    def master():
        while not feeding.wait(0.3):
            axis.to_axis([])
            axis.axis._fed = axis.axis.time

    thread = threading.Thread(target=master, daemon=True)
    thread.start()
    refused(DeviceBusyError, axis.port, "CLOSED_LOOP_CONTROL", "another master")
    feeding.set()
    thread.join()
    axis.axis.state = 4
    refused(DeviceError, axis.port, "MOTOR_CALIBRATION", "IDLE")


@pytest.mark.parametrize(
    "frame",
    [
        command(Command.INPUT_TORQUE, c.encode_torque(0.1)),
        command(Command.AXIS_STATE, c.encode_state(IDLE)),
        Frame(c.identifier(0, Command.ENCODER_ESTIMATES), b"", True, False, 8),
    ],
)
def test_a_second_master_is_noticed_before_and_while_running(axis, frame):
    stop = threading.Event()

    def speak():
        while not stop.wait(0.02):
            axis.inject(frame)

    thread = threading.Thread(target=speak, daemon=True)
    thread.start()
    refused(DeviceBusyError, axis.port, "only one master")
    stop.set()
    thread.join()
    time.sleep(0.1)
    with odrive(axis.port) as device:
        device.exchange(0.1)
        axis.inject(frame)
        with pytest.raises(DeviceBusyError, match="somebody else"):
            for _ in range(200):
                device.exchange(0.1)
    assert axis.axis.state == IDLE


def test_frames_of_other_nodes_change_nothing(axis):
    others = [command(k, bytes(8), node=4) for k in range(32)] + [Frame(0x1ABCDE, b"\1", False, True)]
    with odrive(axis.port) as device:
        for _ in range(10):
            axis.inject(*others)
            assert device.exchange(0.1).status == OK


def test_an_emergency_stop_on_the_bus_ends_the_run_at_zero(axis):
    with odrive(axis.port) as device:
        device.exchange(0.2)
        axis.inject(command(Command.ESTOP))
        with pytest.raises(DeviceError, match="emergency stop"):
            for _ in range(200):
                device.exchange(0.2)
    assert axis.axis.torque == 0.0
    refused(DeviceError, axis.port, "ESTOP_REQUESTED", "clear_fault")
    with odrive(axis.port, clear_fault=True) as device:
        assert any("ESTOP_REQUESTED" in r and "cleared" in r for r in device.remarks)
        assert device.exchange(0.0).status == OK


@pytest.mark.parametrize("dialect", c.DIALECTS)
def test_an_error_of_the_axis_ends_the_run_by_its_name(pty_axis, dialect):
    axis = pty_axis(dialect=dialect, watchdog=None)
    some = list(c.ERRORS[dialect].items())[:: 1 if dialect == "0.5.6" else 3]
    for bit, name in some:
        with odrive(axis.port, firmware=dialect) as device:
            device.exchange(0.1)
            axis.axis.error = bit
            axis.axis.state = IDLE
            with pytest.raises(DeviceError, match=rf"{name}.*zero"):
                for _ in range(1000):
                    device.exchange(0.1)
                    time.sleep(1e-3)
        if (dialect, name) != ("0.5.6", "WATCHDOG_TIMER_EXPIRED"):  # which is no fault there
            refused(DeviceError, axis.port, name, "clear_fault", firmware=dialect)
        axis.axis.error = 0


def test_the_watchdog_is_proven_and_one_that_is_off_or_longer_is_refused(pty_axis):
    good = pty_axis(watchdog=0.1)
    with odrive(good.port, watchdog=0.1, check_watchdog=True) as device:
        assert device.remarks == []
        assert good.axis.counters["watchdog_trips"] == 1
        assert good.axis.state == IDLE
        assert good.axis.error == 0
        for _ in range(20):
            assert device.exchange(0.0).status == OK
    assert all(z.cause in ("watchdog", "disarmed") for z in good.axis.zeroings)
    for watchdog in (None, 2.0):
        bad = pty_axis(watchdog=watchdog)
        refused(DeviceError, bad.port, "stays on", "enable_watchdog", watchdog=0.1, check_watchdog=True)
        assert bad.axis.state == IDLE
    with odrive(good.port, watchdog=0.1) as device:
        assert any("not proven" in r for r in device.remarks)


def test_an_axis_that_does_not_close_its_loop(axis):
    axis.to_axis = lambda frames: [f for f in frames if f.data != c.encode_state(CLOSED_LOOP)]
    refused(DeviceError, axis.port, "does not close its loop", "calibrated", check_watchdog=True)
    with odrive(axis.port, heartbeat_timeout=0.8) as device:
        with pytest.raises(DeviceError, match="does not close its loop; it is IDLE"):
            for _ in range(10_000):
                device.exchange(0.1)
                time.sleep(1e-3)
        assert axis.axis.torque == 0.0


def test_until_the_first_exchange_nothing_is_armed_and_arming_moves_nothing(axis):
    axis.axis.input_torque = 0.7  # what a host before us left behind
    with odrive(axis.port) as device:
        assert axis.axis.state == IDLE
        device.arm()
        assert comes(lambda: axis.axis.state == CLOSED_LOOP)
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
            assert comes(lambda v=volts: axis.axis.torque == pytest.approx(0.25 * v))
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
        assert comes(lambda: axis.axis.torque == pytest.approx(-0.1))


@pytest.mark.parametrize("volts", [math.nan, math.inf, -math.inf, 1e9])
def test_a_command_that_is_no_torque_is_not_sent(axis, volts):
    with odrive(axis.port) as device:
        device.exchange(0.1)
        with pytest.raises(LimitError):
            device.exchange(volts)
        device.exchange(0.2)
        assert comes(lambda: axis.axis.counters["commands"] == 3)
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


def test_a_heartbeat_that_stops_ends_the_run(axis):
    with odrive(axis.port, heartbeat_timeout=0.3) as device:
        device.exchange(0.0)
        axis.to_host = lambda frames: [f for f in frames if f.identifier & 31 != Command.HEARTBEAT]
        with pytest.raises(DeviceError, match="no heartbeat for"):
            for _ in range(1000):
                assert device.exchange(0.0).status == OK
                time.sleep(1e-3)
        axis.to_host = lambda frames: frames
    assert device.disarmed is True


def test_an_axis_that_restarted_is_noticed(axis):
    with odrive(axis.port) as device:
        for _ in range(200):
            device.exchange(0.0)
            time.sleep(1e-3)
        axis.axis = OdriveAxis(axis.axis.plant, axis.axis.facts)
        with pytest.raises(DeviceError, match="not armed any more but IDLE"):
            for _ in range(1000):
                device.exchange(0.0)
                time.sleep(1e-3)


def test_an_unplugged_adapter_is_an_error_and_closing_it_is_not(axis):
    device = odrive(axis.port)
    device.open()
    device.exchange(0.1)
    axis.unplug()
    with pytest.raises(DeviceError, match="has gone"):
        for _ in range(3):
            device.exchange(0.1)
    device.close()
    device.close()
    assert device.disarmed is False
    assert any("not confirmed" in r for r in device.remarks)


def test_closing_does_not_wait_for_an_axis_that_is_silent(axis):
    device = odrive(axis.port)
    device.open()
    device.exchange(0.1)
    axis.to_axis = axis.to_host = lambda _: []
    began = time.monotonic()
    device.close()
    assert time.monotonic() - began < 3.0
    assert device.disarmed is False
    assert any("not confirmed" in r for r in device.remarks)


def test_positions_that_are_coarse_far_from_zero_are_remarked(axis, stage):
    axis.axis.plant.position = 2.0 * math.pi * 1000.0
    with odrive(axis.port, Bench(stage=stage), lead=1e-3) as device:
        (remark,) = [r for r in device.remarks if "single-precision" in r]
        assert "6.1e-08 m" in remark  # 2^-14 turns of 1 mm
    axis.axis.plant.position = axis.axis.plant.velocity = 0.0
    with odrive(axis.port, Bench(stage=stage), lead=1e-3) as device:
        assert not any("single-precision" in r for r in device.remarks)
