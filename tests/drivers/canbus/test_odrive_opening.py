"""Opening `odrive-can` on real ptys: ports, buses, settings and axes that do not fit; what is remarked."""

from __future__ import annotations

import math
import threading
import time

import pytest
from odrive_on_a_port import BENCH, odrive, refused
from rtcomp_drivers import cansimple as c
from rtcomp_drivers.cansimple import CLOSED_LOOP, IDLE
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.registry import create
from waiting import wait

from rtcomp.errors import (
    ConfigError,
    DeviceBusyError,
    DeviceError,
    DeviceTimeoutError,
    ProtocolError,
)
from rtcomp.loop.device import OK


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
        wait(lambda: old.axis.torque == pytest.approx(0.1))
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


def test_positions_that_are_coarse_far_from_zero_are_remarked(axis, stage):
    axis.axis.plant.position = 2.0 * math.pi * 1000.0
    with odrive(axis.port, Bench(stage=stage), lead=1e-3) as device:
        (remark,) = [r for r in device.remarks if "single-precision" in r]
        assert "6.1e-08 m" in remark  # 2^-14 turns of 1 mm
    axis.axis.plant.position = axis.axis.plant.velocity = 0.0
    with odrive(axis.port, Bench(stage=stage), lead=1e-3) as device:
        assert not any("single-precision" in r for r in device.remarks)
