"""The doctor, on this machine and on machines described by a folder."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from rtcomp.cli.main import cli
from rtcomp.doctor import BAD, GOOD, WEAK, Finding, examine


def machine(root: Path, **files: str) -> dict[str, Finding]:
    """What is found on a machine with these files; ``__`` in their names is ``/``."""
    for name, text in files.items():
        path = root / name.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")
    return {f.about: f for f in examine(root)}


CLOCK = "sys__devices__system__clocksource__clocksource0__"


def test_every_finding_that_is_not_good_says_what_follows_and_what_mends_it() -> None:
    for finding in examine():
        assert finding.state in (GOOD, WEAK, BAD) and finding.found
        assert (finding.state == GOOD) == (not finding.means), finding
        assert (finding.state == GOOD) == (not finding.mend), finding


def test_a_machine_made_for_deadlines(tmp_path: Path) -> None:
    found = machine(
        tmp_path,
        sys__kernel__realtime="1",
        sys__devices__system__cpu__isolated="3",
        sys__devices__system__cpu__cpu0__cpufreq__scaling_governor="performance",
        proc__sys__kernel__sched_rt_runtime_us="-1",
        proc__sys__kernel__sched_rt_period_us="1000000",
        **{f"{CLOCK}current_clocksource": "tsc", f"{CLOCK}available_clocksource": "tsc hpet"},
    )
    for about in ("kernel", "processor cores", "frequency governor", "real-time throttling", "clock source"):
        assert found[about].state == GOOD, found[about]
    assert found["kernel"].found == "PREEMPT_RT" and "3" in found["processor cores"].found


def test_a_machine_that_is_not(tmp_path: Path) -> None:
    found = machine(
        tmp_path,
        proc__version="Linux version 6.1 #1 SMP PREEMPT_DYNAMIC",
        sys__devices__system__cpu__cpu0__cpufreq__scaling_governor="powersave",
        proc__sys__kernel__sched_rt_runtime_us="100000",
        proc__sys__kernel__sched_rt_period_us="1000000",
        **{f"{CLOCK}current_clocksource": "hpet", f"{CLOCK}available_clocksource": "tsc hpet"},
    )
    assert found["kernel"].state == WEAK and "PREEMPT_DYNAMIC" in found["kernel"].found
    assert found["frequency governor"].mend == "sudo cpupower frequency-set -g performance"
    assert found["real-time throttling"].state == BAD
    assert found["clock source"].mend.startswith("echo tsc | sudo tee /sys/devices/system/clocksource/")


def test_a_port_that_keeps_answers_back_and_one_that_is_taken(tmp_path: Path) -> None:
    files = {
        "sys__class__tty__ttyUSB0__device__latency_timer": "16",
        "sys__class__tty__ttyUSB1__device__latency_timer": "1",
        "sys__class__tty__ttyACM0__dev": "166:0",
        "dev__ttyUSB0": "",
        "dev__ttyUSB1": "",
        "dev__ttyACM0": "",
        "proc__4711__comm": "minicom",
        "proc__4711__fd__keep": "",
    }
    (tmp_path / "proc/4711/fd").mkdir(parents=True)
    (tmp_path / "proc/4711/fd/5").symlink_to("/dev/ttyACM0")
    del files["proc__4711__fd__keep"]
    found = machine(tmp_path, **files)
    slow = found["serial port /dev/ttyUSB0"]
    assert slow.state == WEAK and "59 Hz" in slow.means
    assert slow.mend == "echo 1 | sudo tee /sys/class/tty/ttyUSB0/device/latency_timer"
    assert found["serial port /dev/ttyUSB1"].state == GOOD
    taken = found["serial port /dev/ttyACM0"]
    assert taken.state == BAD and "minicom (process 4711)" in taken.found


AS_NOBODY = """
import os
from pathlib import Path
from rtcomp.doctor.deadlines import deadlines
if os.geteuid() == 0:
    os.setresuid(65534, 65534, 65534)
for f in deadlines(Path("/")):
    print(f.about, f.state, f.mend, sep="|")
"""


def test_can_interfaces_up_down_and_others(tmp_path: Path) -> None:
    found = machine(
        tmp_path,
        sys__class__net__can0__type="280", sys__class__net__can0__operstate="down",
        sys__class__net__can1__type="280", sys__class__net__can1__operstate="up",
        sys__class__net__eth0__type="1", sys__class__net__eth0__operstate="down",
    )  # fmt: skip
    down = found["CAN interface can0"]
    assert down.state == BAD and down.mend == "sudo ip link set can0 up type can bitrate 1000000"
    assert found["CAN interface can1"].state == GOOD
    assert "CAN interface eth0" not in found


def test_without_rights_it_says_how_to_get_them() -> None:
    """In a process of a user who has none."""
    done = subprocess.run([sys.executable, "-c", AS_NOBODY], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = dict(line.split("|", 1) for line in done.stdout.splitlines())
    if lines["scheduling"].startswith("good"):
        pytest.skip("everybody may use SCHED_FIFO here")
    assert lines["scheduling"].startswith("bad|echo ") and "rtprio" in lines["scheduling"]


def test_the_command_prints_it_for_people_and_for_programs() -> None:
    shown = CliRunner().invoke(cli, ["doctor"])
    assert shown.exit_code == 0 and "scheduling" in shown.output and "as they should be" in shown.output
    found = json.loads(CliRunner().invoke(cli, ["doctor", "--json"]).output)
    assert {"about", "state", "found", "means", "mend"} == set(found[0])
    assert "drivers" in [f["about"] for f in found]
