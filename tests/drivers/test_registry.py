"""Drivers by name: found without being imported, built from checked settings, described for people."""

from __future__ import annotations

import subprocess
import sys

import pytest
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.registry import create, describe, find, names
from rtcomp_drivers.simulated import SimulatedDriver

from rtcomp.errors import ConfigError
from rtcomp.loop.device import Device
from rtcomp.yamlfile import load_yaml


def test_the_drivers_of_the_package_are_installed():
    assert {"simulated", "replay", "serial"} <= set(names())


def test_listing_names_imports_no_driver():
    script = (
        "import sys; from rtcomp_drivers.registry import names; names();"
        "print([m for m in ('numba', 'serial', 'pydantic', 'rtcomp_drivers.simulated') if m in sys.modules])"
    )
    assert subprocess.check_output([sys.executable, "-c", script], text=True).strip() == "[]"


def test_a_driver_is_built_from_settings_and_bench(stage):
    device = create({"driver": "simulated", "delay_ticks": 1}, Bench(stage=stage))
    assert isinstance(device, SimulatedDriver)
    assert isinstance(device, Device)
    assert device.delay_ticks == 1


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (
            {"driver": "serail", "port": "x"},
            ["'serail'", "did you mean 'serial'", "replay, serial, simulated"],
        ),
        ({}, ["driver", "missing", "serial"]),
        ({"driver": 3}, ["driver", "3"]),
        ({"driver": "simulated", "delay": 1}, ["delay", "delay_ticks"]),
        ({"driver": "simulated", "delay_ticks": 2}, ["delay_ticks", "2"]),
        ({"driver": "replay"}, ["recording"]),
    ],
)
def test_settings_that_are_wrong_end_in_one_clear_line(stage, settings, words):
    with pytest.raises(ConfigError) as caught:
        create(settings, Bench(stage=stage))
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_with_the_file_at_hand_the_line_is_named(tmp_path, stage):
    path = tmp_path / "run.yaml"
    path.write_text("rate: 1000\ndevice:\n  driver: serial\n  prot: /dev/ttyACM0\n")
    file = load_yaml(path)
    with pytest.raises(ConfigError, match=r"run\.yaml:4: .*prot.*port"):
        create(file.data["device"], Bench(stage=stage), file)
    path.write_text("rate: 1000\ndevice:\n  driver: serila\n")
    file = load_yaml(path)
    with pytest.raises(ConfigError, match=r"run\.yaml:3: .*serila.*serial"):
        create(file.data["device"], Bench(stage=stage), file)


def test_a_simulated_device_without_a_stage_is_refused():
    with pytest.raises(ConfigError, match="stage"):
        create({"driver": "simulated"}, Bench())


def test_every_driver_is_described_whole():
    for description in describe():
        assert description.available
        assert description.says.endswith(".")
        for setting in description.settings:
            assert setting.says, f"{description.name}.{setting.name}"
    serial = {s.name: s for s in next(d for d in describe() if d.name == "serial").settings}
    assert serial["port"].required
    assert serial["watchdog"].default == 0.1


def test_a_third_party_s_driver_is_found_and_a_broken_one_is_said_to_be(tmp_path, monkeypatch):
    folder = tmp_path / "mine-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text("[rtcomp.drivers]\nmine = mine:Mine\nbroken = not_there:X\n")
    (tmp_path / "mine.py").write_text(
        "from rtcomp_drivers.driver import Driver, DriverSettings\n"
        "class Mine(Driver):\n    '''Mine.'''\n    name = 'mine'\n    Settings = DriverSettings\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    assert create({"driver": "mine"}, Bench()).name == "mine"
    broken = next(d for d in describe() if d.name == "broken")
    assert not broken.available
    assert "not_there" in broken.says
    with pytest.raises(ConfigError, match="not_there"):
        find("broken")
