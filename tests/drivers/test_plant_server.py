"""The plant server as the process it is: real time, a watchdog that no host can outlive, an orderly end."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time

import pytest
import yaml
from pushing_host import pushing
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.plant_process import PlantProcess
from rtcomp_drivers.registry import create

from rtcomp.errors import DeviceError

WATCHDOG_S = 0.1
SLACK_S = 0.25
"""For processes that wait for a processor on a busy machine; the board's own clock knows none."""


@pytest.fixture
def host(plant):
    """A loop in another process, pushing the stage with 1 V at about 1 kHz."""
    settings = {"driver": "serial", "port": plant.port, "watchdog": WATCHDOG_S}
    with pushing(reply_timeout=0.05, max_missed=100_000, **settings) as process:
        yield process


def connect(plant, **settings):
    settings = {"reply_timeout": 0.1, "watchdog": 2.0, **settings}
    return create({"driver": "serial", "port": plant.port, **settings}, Bench(period=1e-3))


def check_zeroed_by_watchdog(summary, silent_since):
    (zeroing,) = summary["zeroings"]
    assert zeroing["cause"] == "watchdog"
    assert zeroing["since_command"] == pytest.approx(WATCHDOG_S, abs=1e-6)
    assert zeroing["noticed_after"] < SLACK_S
    after_silence = summary["started_monotonic_s"] + zeroing["time"] - silent_since
    assert after_silence < WATCHDOG_S + SLACK_S
    assert summary["watchdog_trips"] == 1


def test_a_killed_host_leaves_a_zero_output(plant, host):
    host.send_signal(signal.SIGKILL)
    killed = time.monotonic()
    time.sleep(WATCHDOG_S + SLACK_S)
    with pytest.raises(DeviceError, match="FAULT"):
        connect(plant).open()
    with connect(plant, clear_fault=True) as device:  # the port is free again and the stage still there
        assert device.exchange(0.0).position > 0.0
    summary = plant.stop()
    summary["zeroings"].pop()  # our own, orderly
    check_zeroed_by_watchdog(summary, killed)


def test_a_stopped_host_leaves_a_zero_output_and_gets_no_say_when_it_goes_on(plant, host):
    host.send_signal(signal.SIGSTOP)
    stopped = time.monotonic()
    time.sleep(WATCHDOG_S + SLACK_S)
    host.send_signal(signal.SIGCONT)
    _, errors = host.communicate(timeout=20)
    assert host.returncode != 0
    assert b"DeviceError" in errors
    check_zeroed_by_watchdog(plant.stop(), stopped)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_in_order(stage_file, tmp_path, number):
    log = tmp_path / "log.json"
    command = [sys.executable, "-m", "rtcomp_drivers.plant_server", "--config", str(stage_file), "--serial"]
    with subprocess.Popen(
        [*command, "--log", str(log)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as server:
        line = server.stdout.readline()
        assert line.startswith("port: /dev/")
        device = create({"driver": "serial", "port": line.split()[1]}, Bench(period=1e-3))
        device.open()
        device.exchange(2.0)
        server.send_signal(number)
        rest, errors = server.communicate(timeout=20)
    assert (server.returncode, rest, errors) == (0, "", "")
    summary = json.loads(log.read_text())
    assert [z["cause"] for z in summary["zeroings"]] == ["shut down"]
    device.close()  # whose board has gone


PARENT = """
import sys, time
from rtcomp_drivers.plant_process import PlantProcess
with PlantProcess(sys.argv[1]) as plant:
    print(plant.process.pid, plant.port, flush=True)
    time.sleep(600.0)
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_it_does_not_outlive_the_process_that_started_it(stage_file, number):
    with subprocess.Popen(
        [sys.executable, "-c", PARENT, str(stage_file)], stdout=subprocess.PIPE, text=True
    ) as parent:
        pid, port = parent.stdout.readline().split()
        device = create({"driver": "serial", "port": port, "watchdog": 2.0}, Bench(period=1e-3))
        device.open()
        device.exchange(1.0)
        ends = os.pidfd_open(int(pid))
        try:
            assert not select.select([ends], [], [], 0.0)[0]
            parent.send_signal(number)
            assert select.select([ends], [], [], 20.0)[0], "the server outlives its parent"
        finally:
            os.close(ends)
    with pytest.raises(DeviceError):
        for _ in range(20):
            device.exchange(1.0)
    device.close()


def test_without_a_pipe_to_hold_on_to_it_stays(stage_file):
    """Its standard input at its end from the start: started from a service or with </dev/null."""
    command = [sys.executable, "-m", "rtcomp_drivers.plant_server", "--config", str(stage_file), "--serial"]
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as server:
        assert server.stdout.readline().startswith("port: /dev/")
        with pytest.raises(subprocess.TimeoutExpired):
            server.wait(0.5)
        server.terminate()
        assert server.communicate(timeout=20)[0] == ""
        assert server.returncode == 0


def test_it_moves_in_real_time_with_and_without_a_host(plant):
    with connect(plant) as device:
        first = device.exchange(0.0)
        began = time.monotonic()
        time.sleep(0.3)
        second = device.exchange(0.0)
        ended = time.monotonic()
    assert second.time - first.time == pytest.approx(ended - began, abs=SLACK_S)
    time.sleep(0.3)
    with connect(plant) as device:
        third = device.exchange(0.0)
    assert third.time - second.time >= 0.3
    assert plant.stop()["lost_s"] == 0.0


def test_it_is_the_stage_of_the_file(plant, stage):
    """Pushed by a small constant force, it swings about the place where the stage's own friction holds it."""
    volts = 0.04
    with connect(plant) as device:
        positions = []
        for _ in range(500):
            positions.append(device.exchange(volts).position)
            time.sleep(1e-3)
    elements = stage.file.stage.friction
    held_at = volts * stage.force_constant / sum(e.stiffness for e in elements)
    assert 2.0 * held_at < min(e.reach for e in elements)  # nothing yields, even at the height of the swing
    assert max(positions) > 1.5 * held_at
    assert sum(positions) / len(positions) == pytest.approx(held_at, rel=0.1)


def test_the_summary_accounts_for_every_frame(plant):
    with connect(plant) as device:
        for _ in range(200):
            device.exchange(0.0)
    summary = plant.stop()
    assert summary["commands"] + summary["superseded"] == device.counters["sent"] == 202
    assert summary["ignored"] == 1
    assert summary["bad_frames"] == summary["unknown_frames"] == summary["watchdog_trips"] == 0
    assert 0.0 < summary["max_step_lag_s"] < 1.0
    assert summary["scheduling"] == plant.scheduling


def test_a_server_that_was_stopped_has_its_watchdog_act_all_the_same(plant):
    """A board's timer does not stop with its processor: the output was zero long before anybody looked."""
    with connect(plant, watchdog=WATCHDOG_S) as device:
        device.exchange(1.0)
        os.kill(plant.pid, signal.SIGSTOP)
        time.sleep(0.5)
        os.kill(plant.pid, signal.SIGCONT)
        time.sleep(WATCHDOG_S + SLACK_S)
        with pytest.raises(DeviceError, match="FAULT"):
            for _ in range(20):
                device.exchange(1.0)
    (zeroing,) = plant.stop()["zeroings"]
    assert zeroing["cause"] == "watchdog"
    assert zeroing["since_command"] == pytest.approx(WATCHDOG_S, abs=1e-6)


def test_a_stage_too_stiff_for_real_time_says_so_and_still_obeys(tmp_path):
    path = tmp_path / "stiff.yaml"
    stage = {
        "mass": 1e-4,
        "force_constant": 1.0,
        "voltage_limit": 1.0,
        "friction": [{"stiffness": 1e10, "reach": 1e-6}],
    }
    path.write_text(yaml.safe_dump({"stage": stage, "rate": 1000.0}))
    with subprocess.Popen(
        [
            sys.executable,
            "-m",
            "rtcomp_drivers.plant_server",
            "--config",
            str(path),
            "--serial",
            "--no-realtime",
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as server:
        server.stdout.readline()
        assert select.select([server.stderr], [], [], 30.0)[0]
        assert b"cannot keep up" in server.stderr.readline()
        server.terminate()
        _, errors = server.communicate(timeout=10)
    summary = json.loads(errors)
    assert summary["lost_s"] > 0.0
    assert summary["seconds_too_slow"] >= 1


def test_a_configuration_that_is_wrong_ends_it_with_one_line(tmp_path):
    path = tmp_path / "stage.yaml"
    path.write_text("stage: {mass: -1.0, force_constant: 1.0, voltage_limit: 1.0}\n")
    command = [sys.executable, "-m", "rtcomp_drivers.plant_server", "--config", str(path), "--serial"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 2
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    with pytest.raises(DeviceError, match="mass"):
        PlantProcess(path)
