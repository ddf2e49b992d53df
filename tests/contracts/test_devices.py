"""What every device keeps to, run over every driver of the package: in process, replayed, and on a real port.

A driver of a third party is held to the same by adding it to `KINDS`.
"""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.plant_process import PlantProcess
from rtcomp_drivers.protocol import DISARMED
from rtcomp_drivers.registry import create, find, names

from rtcomp.errors import DeviceError, LimitError, RtcompError
from rtcomp.loop.device import OK, Device, Sample
from rtcomp.stage.stage import Stage

PERIOD = 1e-3
STAGE = {
    "stage": {"mass": 1.0, "force_constant": 2.0, "voltage_limit": 5.0, "viscous": 1.0},
    "sensor": {"resolution": 1e-9},
    "rate": 1.0 / PERIOD,
}
KINDS = ["simulated", "simulated, delayed", "replay", "serial", "odrive-can", "cia402"]
LINKS = ("serial", "odrive-can", "cia402")


@dataclass
class Bed:
    """A device on the test bed."""

    device: Device
    kind: str

    def tick(self, volts: float) -> Sample:
        if self.kind in LINKS:
            time.sleep(PERIOD)
        return self.device.exchange(volts)


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    with _serving(tmp_path_factory, "serial") as process:
        yield process


@pytest.fixture(scope="module")
def odrive(tmp_path_factory):
    with _serving(tmp_path_factory, "odrive-can", watchdog=1.0) as process:
        yield process


@pytest.fixture(scope="module")
def canopen_drive(tmp_path_factory):
    with _serving(tmp_path_factory, "cia402") as process:
        yield process


def _serving(tmp_path_factory, link, **more):
    path = tmp_path_factory.mktemp("devices") / "stage.yaml"
    path.write_text(yaml.safe_dump(STAGE))
    return PlantProcess(path, link=link, **more)


@pytest.fixture(params=KINDS)
def bed(request):
    bench = {"stage": Stage.from_dict(STAGE), "period": PERIOD}
    kind = request.param
    settings = {"driver": kind.split(",")[0]}
    if kind.endswith("delayed"):
        settings["delay_ticks"] = 1
    elif kind == "replay":
        t = PERIOD * np.arange(500)
        bench["recording"] = SimpleNamespace(
            columns={"time": t, "position": 1e-4 * np.sin(9 * t), "voltage": np.cos(9 * t)}
        )
    elif kind == "serial":
        port = request.getfixturevalue("plant").port
        settings |= {"port": port, "watchdog": 1.0, "reply_timeout": 0.2}
    elif kind == "odrive-can":
        port = request.getfixturevalue("odrive").port
        settings |= {"interface": "slcan", "channel": port, "lead": 1e-3}
        settings |= {"watchdog": 1.0, "check_watchdog": False, "reply_timeout": 0.2}
    elif kind == "cia402":
        port = request.getfixturevalue("canopen_drive").port
        settings |= {"interface": "slcan", "channel": port, "node": 5}
        settings |= {"watchdog": 1.0, "reply_timeout": 0.2}
    device = create(settings, Bench(**bench))
    yield Bed(device, kind)
    device.close()


def test_every_installed_driver_is_held_to_this():
    of_the_package = {n for n in names() if find(n).__module__.startswith("rtcomp_drivers.")}
    assert of_the_package == {k.split(",")[0] for k in KINDS}


def test_it_is_a_device(bed):
    assert isinstance(bed.device, Device)
    assert bed.device.delay_ticks == {"simulated": 0, "replay": 0}.get(bed.kind, 1)


def test_opening_and_closing_again_changes_nothing(bed):
    bed.device.close()
    bed.device.open()
    first = bed.tick(0.1)
    bed.device.open()
    assert bed.tick(0.1).sequence == first.sequence + 1
    bed.device.close()
    bed.device.close()


def test_an_exchange_needs_an_open_device(bed):
    with pytest.raises(DeviceError, match=r"open\(\)"):
        bed.device.exchange(0.0)
    bed.device.open()
    bed.tick(0.0)
    bed.device.close()
    with pytest.raises(DeviceError, match=r"open\(\)"):
        bed.device.exchange(0.0)


def test_samples_are_in_order_and_finite(bed):
    bed.device.open()
    samples = [bed.tick(math.sin(0.1 * k)) for k in range(100)]
    assert all(type(s) is Sample for s in samples)
    assert all(math.isfinite(s.position) and math.isfinite(s.time) for s in samples)
    for before, after in itertools.pairwise(samples):
        assert after.sequence == before.sequence + 1
        assert after.time > before.time
        assert after.status == OK


@pytest.mark.parametrize("volts", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_no_number_is_refused_before_it_does_anything(bed, volts):
    bed.device.open()
    before = bed.tick(0.5)
    with pytest.raises(LimitError, match="finite") as caught:
        bed.device.exchange(volts)
    assert isinstance(caught.value, ValueError)
    assert isinstance(caught.value, RtcompError)
    after = bed.tick(0.5)
    assert after.sequence == before.sequence + 1


def test_it_works_again_after_closing(bed):
    for _ in range(3):
        bed.device.open()
        samples = [bed.tick(0.2) for _ in range(20)]
        assert [s.status for s in samples] == [OK] * 20
        bed.device.close()


def test_a_positive_command_moves_it_forward(bed):
    if bed.kind == "replay":
        pytest.skip("a recording has moved already")
    bed.device.open()
    first = bed.tick(2.0)
    for _ in range(50):
        last = bed.tick(2.0)
    assert last.position > first.position


def test_closing_leaves_the_output_at_zero(bed):
    if bed.kind == "replay":
        pytest.skip("a recording has no output")
    device = bed.device
    device.open()
    for _ in range(20):
        bed.tick(3.0)
    if bed.kind in LINKS:
        device.close()
        assert device.disarmed
        device.open()
        if bed.kind == "serial":
            assert device.info.state == DISARMED
        assert device.output == 0.0
        drift = [bed.tick(0.0) for _ in range(100)]
        # Nothing pushes it; it only slows down. Where the times are the host's, that is seen in the long run.
        every = 10 if bed.kind == "serial" else 33
        position, at = ([s[k] for s in drift][:: 1 if bed.kind == "serial" else every] for k in (0, 1))
        speeds = np.diff(position) / np.diff(at)
        assert np.all(np.diff(speeds[:: every if bed.kind == "serial" else 1]) < 0.0)
    else:
        simulator = device.simulator
        speed = simulator.velocity
        device.close()
        # Without friction but the viscous: a period without force, and so a little slower.
        assert simulator.velocity == pytest.approx(speed * math.exp(-PERIOD * 1.0 / 1.0), rel=1e-6)


def test_closing_after_an_error_in_the_loop_is_closing(bed):
    bed.device.open()
    with pytest.raises(LimitError):
        bed.device.exchange(math.nan)
    bed.device.close()
    bed.device.open()
    assert bed.tick(0.0).status == OK
