"""The firmware as a process on a pty, a stage in another, the driver in this one: all in real time."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import pytest
from pushing_host import pushing
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.plant_process import PlantProcess
from rtcomp_drivers.registry import create

from rtcomp.errors import DeviceError
from rtcomp.loop.device import OK

WATCHDOG_S = 0.1


def test_the_driver_moves_the_stage_through_it(stage_file: Path, built: Path) -> None:
    with PlantProcess(stage_file, firmware=built / "rtcomp-board") as plant:
        device = create({"driver": "serial", "port": plant.port, "reply_timeout": 0.5}, Bench(period=1e-3))
        device.open()
        samples = []
        try:
            for _ in range(300):
                samples.append(device.exchange(0.9))
                time.sleep(1e-3)
        finally:
            device.close()
        summary = plant.stop()
    good = [s for s in samples if s.status & OK == OK]
    assert len(good) > 200
    assert good[-1].position > good[0].position + 1e-5
    assert summary["commands"] > 200 and summary["bad_frames"] == 0
    assert summary["output"] == 0.0 and summary["watchdog_trips"] == 0


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "stopped"])
def test_without_a_host_it_zeroes_within_its_watchdog(stage_file: Path, built: Path, number: int) -> None:
    with PlantProcess(stage_file, firmware=built / "rtcomp-board") as plant:
        settings = {"driver": "serial", "port": plant.port, "watchdog": WATCHDOG_S}
        with pushing(volts=0.5, reply_timeout=0.2, **settings) as host:
            time.sleep(0.3)
            host.send_signal(number)
            time.sleep(3 * WATCHDOG_S)
        summary = plant.stop()
    assert summary["watchdog_trips"] == 1 and summary["state"] == 2
    (zeroed,) = summary["zeroings"]
    assert WATCHDOG_S - 1e-3 <= zeroed["since_asked"] <= WATCHDOG_S + 0.02


def test_ended_while_it_drives_it_leaves_zero(stage_file: Path, built: Path) -> None:
    with PlantProcess(stage_file, firmware=built / "rtcomp-board") as plant:
        device = create({"driver": "serial", "port": plant.port, "reply_timeout": 0.5}, Bench(period=1e-3))
        device.open()
        device.exchange(0.5)
        summary = plant.stop()
        with pytest.raises(DeviceError):
            for _ in range(1000):
                device.exchange(0.5)
        device.close()
    assert summary["output"] == 0.0 and summary["state"] == 0 and len(summary["zeroings"]) == 1


def test_a_program_that_is_none_is_one_clear_line(stage_file: Path, tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"firmware .*nothing-here: cannot be run"):
        PlantProcess(stage_file, firmware=tmp_path / "nothing-here")
