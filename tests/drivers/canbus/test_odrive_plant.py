"""A stage behind an ODrive on a CAN bus, in a process of its own: no host outlives its watchdog."""

from __future__ import annotations

import random
import signal
import time

import pytest
from pushing_host import MOMENTS, pushing
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.plant_process import PlantProcess
from rtcomp_drivers.registry import create

from rtcomp.errors import ConfigError, DeviceError
from rtcomp.loop.device import OK

WATCHDOG_S = 0.1
"""The plant server's axis has this one."""
SLACK_S = 0.25
"""For processes that wait for a processor on a busy machine; the axis' own clock knows none."""
LEAD = 1e-3


@pytest.fixture
def plant(stage_file):
    with PlantProcess(stage_file, link="odrive-can") as process:
        yield process


def connect(plant, stage, **settings):
    settings = {"interface": "slcan", "channel": plant.port, "lead": LEAD, "reply_timeout": 0.1, **settings}
    return create({"driver": "odrive-can", **settings}, Bench(stage=stage, period=1e-3))


def host(plant, stage_file):
    """A loop in another process, pushing the stage with 1 V at about 1 kHz."""
    settings = {"driver": "odrive-can", "interface": "slcan", "channel": plant.port, "lead": LEAD}
    return pushing(stage_file, reply_timeout=0.05, max_missed=100_000, clear_fault=True, **settings)


def test_it_is_the_stage_of_the_file(stage_file, stage):
    """Pushed by a small constant force, it swings about the place where the stage's own friction holds it."""
    volts = 0.04
    plant = PlantProcess(stage_file, link="odrive-can", watchdog=0.5)
    with plant, connect(plant, stage, watchdog=0.5) as device:
        positions = []
        for _ in range(500):
            sample = device.exchange(volts)
            if sample.status == OK:
                positions.append(sample.position)
            time.sleep(1e-3)
    held_at = volts * stage.force_constant / sum(e.stiffness for e in stage.file.stage.friction)
    assert max(positions) > 1.5 * held_at
    assert sum(positions) / len(positions) == pytest.approx(held_at, rel=0.1)
    summary = plant.stop()
    assert summary["bad_frames"] == summary["clamped"] == summary["ignored"] == summary["unknown"] == 0
    assert [z["cause"] for z in summary["zeroings"]] == ["watchdog", "disarmed"]  # proven, then closed
    assert summary["state"] == "IDLE"


@pytest.mark.parametrize("moments", [2, pytest.param(MOMENTS, marks=pytest.mark.slow)])
def test_killed_or_stopped_at_any_moment_the_host_leaves_a_zero_output(stage_file, stage, moments):
    noise = random.Random(11)
    gone = []
    with PlantProcess(stage_file, link="odrive-can") as plant:
        for k in range(moments):
            with host(plant, stage_file) as process:
                running = time.monotonic()
                time.sleep(0.2 * noise.random())
                process.send_signal(signal.SIGSTOP if k % 2 else signal.SIGKILL)
                gone.append((running, time.monotonic()))
                time.sleep(WATCHDOG_S + SLACK_S)
        with connect(plant, stage, clear_fault=True) as device:
            assert any("WATCHDOG_TIMER_EXPIRED" in r for r in device.remarks)
            assert device.output == 0.0
            assert device._last.status == OK
        summary = plant.stop()
    began = summary["started_monotonic_s"]
    for running, moment in gone:
        end = moment + WATCHDOG_S + SLACK_S
        last = [z for z in summary["zeroings"] if began + z["time"] <= end][-1]
        assert last["cause"] == "watchdog"
        assert began + last["time"] > running  # and not that of the proof when the host opened
        assert last["since_command"] == pytest.approx(WATCHDOG_S, abs=1e-6)
        assert last["noticed_after"] < SLACK_S


def test_a_host_that_goes_on_after_its_watchdog_gets_no_say(plant, stage_file):
    with host(plant, stage_file) as process:
        process.send_signal(signal.SIGSTOP)
        time.sleep(WATCHDOG_S + SLACK_S)
        process.send_signal(signal.SIGCONT)
        _, errors = process.communicate(timeout=20)
    assert process.returncode != 0
    assert b"WATCHDOG_TIMER_EXPIRED" in errors
    assert {z["cause"] for z in plant.stop()["zeroings"]} == {"watchdog"}


def test_a_host_that_is_interrupted_leaves_in_order(plant, stage_file):
    with host(plant, stage_file) as process:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=20)
    assert plant.stop()["zeroings"][-1]["cause"] == "disarmed"


def test_a_plant_that_dies_ends_the_host_by_an_error(plant, stage):
    with connect(plant, stage) as device:
        device.exchange(0.5)
        plant.kill()
        with pytest.raises(DeviceError):
            for _ in range(200):
                device.exchange(0.5)
    assert device.disarmed is False


def test_links_that_there_are_not(stage_file, stage):
    from rtcomp_drivers.plant_links import build

    with pytest.raises(ConfigError, match=r"'odrive'.*did you mean 'odrive-can'"):
        build("odrive", None, stage)
    with pytest.raises(DeviceError, match="invalid choice"):
        PlantProcess(stage_file, link="odrive")
    with pytest.raises(DeviceError, match="'serial' the host sets the watchdog"):
        PlantProcess(stage_file, watchdog=0.5)
    with pytest.raises(DeviceError, match="leave --watchdog out"):
        PlantProcess(stage_file, watchdog=0.5, firmware="/bin/true")
    with pytest.raises(DeviceError, match=r"firmware.*'serial'"):
        PlantProcess(stage_file, link="odrive-can", firmware="/bin/true")
