"""What ends a run of `odrive-can` on real ptys: other masters, errors, silence; and closing it."""

from __future__ import annotations

import threading
import time

import pytest
from odrive_on_a_port import command, odrive, refused
from rtcomp_drivers import cansimple as c
from rtcomp_drivers.cansimple import CLOSED_LOOP, IDLE, Command
from rtcomp_drivers.odrive_axis import OdriveAxis
from rtcomp_drivers.slcan import Frame
from waiting import keep_on

from rtcomp.errors import DeviceBusyError, DeviceError
from rtcomp.loop.device import OK


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


@pytest.mark.parametrize("dialect", ["0.6", pytest.param("0.5.6", marks=pytest.mark.slow)])
def test_an_error_of_the_axis_ends_the_run_by_its_name(pty_axis, dialect):
    axis = pty_axis(dialect=dialect, watchdog=None)
    some = list(c.ERRORS[dialect].items())[:: 1 if dialect == "0.5.6" else 3]
    for bit, name in some:
        with odrive(axis.port, firmware=dialect) as device:
            device.exchange(0.1)
            axis.axis.error = bit
            axis.axis.state = IDLE
            with pytest.raises(DeviceError, match=rf"{name}.*zero"):
                keep_on(device, 0.1)()
        if (dialect, name) != ("0.5.6", "WATCHDOG_TIMER_EXPIRED"):  # which is no fault there
            refused(DeviceError, axis.port, name, "clear_fault", firmware=dialect)
        axis.axis.error = 0


def test_an_axis_that_does_not_close_its_loop(axis):
    axis.to_axis = lambda frames: [f for f in frames if f.data != c.encode_state(CLOSED_LOOP)]
    refused(DeviceError, axis.port, "does not close its loop", "calibrated", check_watchdog=True)
    with odrive(axis.port, heartbeat_timeout=0.8) as device:
        with pytest.raises(DeviceError, match="does not close its loop; it is IDLE"):
            keep_on(device, 0.1, seconds=10.0)()
        assert axis.axis.torque == 0.0


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
            keep_on(device)()


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
