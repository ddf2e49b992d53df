"""The driver over slcan on a pseudo-terminal, the axis in a process of its own: unplugged, killed."""

from __future__ import annotations

import random
import signal
import threading
import time

import pytest
from pushing_host import MOMENTS, pushing
from rtcomp_drivers.cia402_states import State
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.plant_process import PlantProcess
from rtcomp_drivers.registry import create

from rtcomp.errors import DeviceError, DeviceTimeoutError
from rtcomp.loop.device import OK

WATCHDOG_S = 0.1
SLACK_S = 0.25
"""For processes that wait for a processor on a busy machine; the axis' own clock knows none."""


@pytest.fixture
def plant(stage_file):
    with PlantProcess(stage_file, link="cia402") as process:
        yield process


def connect(plant, stage, **settings):
    place = {"interface": "slcan", "channel": plant.port, "node": 5}
    settings = {"driver": "cia402", "reply_timeout": 0.1, "watchdog": 2.0, **place, **settings}
    return create(settings, Bench(stage=stage, period=1e-3))


def host(plant):
    """A loop in another process, pushing the stage with 1 V at about 1 kHz."""
    place = {"interface": "slcan", "channel": plant.port, "node": 5, "clear_fault": True}
    settings = {"driver": "cia402", "watchdog": WATCHDOG_S, "reply_timeout": 0.05, **place}
    return pushing(max_missed=100_000, **settings)


def test_it_moves_and_stands_where_it_was_left(plant, stage):
    with connect(plant, stage) as device:
        began = device.exchange(0.0).position
        for _ in range(100):
            sample = device.exchange(3.0)
            time.sleep(1e-3)
        assert sample.status == OK
        assert sample.position > began + 1e-5
    with connect(plant, stage) as device:
        assert device.exchange(0.0).position > began + 1e-5
    summary = plant.stop()
    assert [z["cause"] for z in summary["zeroings"]] == ["disabled", "disabled"]
    assert summary["watchdog_trips"] == summary["bad_frames"] == summary["emergencies"] == 0


def test_no_thread_stands_beside_the_loop(plant, stage):
    before = threading.active_count()
    with connect(plant, stage) as device:
        device.exchange(0.0)
        assert threading.active_count() == before


@pytest.mark.parametrize(
    ("how", "times"),
    [
        (signal.SIGKILL, 1),
        (signal.SIGSTOP, 1),
        pytest.param(signal.SIGKILL, MOMENTS, marks=pytest.mark.slow),
        pytest.param(signal.SIGSTOP, MOMENTS, marks=pytest.mark.slow),
    ],
)
def test_a_host_that_dies_or_stands_still_leaves_a_zero_output(plant, stage, how, times):
    rng = random.Random(402)
    silent = []
    for _ in range(times):
        with host(plant) as process:
            time.sleep(rng.uniform(0.0, 0.3))
            process.send_signal(how)
            silent.append(time.monotonic())
            time.sleep(WATCHDOG_S + SLACK_S)
    with pytest.raises(DeviceError, match=r"fault: heartbeat of the host lost \(8130h\)"):
        connect(plant, stage).open()
    with connect(plant, stage, clear_fault=True) as device:
        assert device.state is State.DISABLED
        assert device.exchange(0.0).status == OK  # armed: and yet no torque
        assert device._drive.read(0x6077) == 0
    summary = plant.stop()
    watchdog = [z for z in summary["zeroings"] if z["cause"] == "watchdog"]
    assert len(watchdog) == times
    for zeroing, silent_since in zip(watchdog, silent, strict=True):
        assert zeroing["since_command"] <= WATCHDOG_S + 2e-3  # its heartbeat follows a command a frame later
        after_silence = summary["started_monotonic_s"] + zeroing["time"] - silent_since
        assert after_silence < WATCHDOG_S + SLACK_S + summary["lost_s"]  # that much its clock was put on
        assert zeroing["noticed_after"] < SLACK_S


def test_an_interrupted_host_disables_by_itself(plant):
    with host(plant) as process:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=10.0)
    (zeroing,) = plant.stop()["zeroings"]
    assert zeroing["cause"] == "disabled"


def test_unplugged_while_running(plant, stage):
    device = connect(plant, stage)
    with device:
        device.exchange(0.5)
        plant.kill()
        with pytest.raises(DeviceError, match="has gone"):
            for _ in range(1000):
                device.exchange(0.5)
                time.sleep(1e-3)
    assert device.disarmed is False
    assert any("watchdog must see to it" in remark for remark in device.remarks)


def test_a_bit_rate_that_is_not_the_buss(plant, stage):
    with pytest.raises(DeviceTimeoutError, match="does not answer at 500000 bit/s"):
        connect(plant, stage, bitrate=500_000).open()
