"""Against a stranger's ODrive: the mock of the package `odrive-can`, in a process of its own.

It knows velocity control only, sends positions ten times a second, and has neither errors nor a watchdog; it
proves the frames and the handshake, by somebody who did not read this code.
"""

from __future__ import annotations

import subprocess
import sys
import time

import pytest
from rtcomp_drivers import cansimple as c
from rtcomp_drivers.can_link import CanLink, CanSettings
from rtcomp_drivers.cansimple import CLOSED_LOOP, IDLE, Command
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.odrive_link import OdriveLink
from rtcomp_drivers.registry import create

from rtcomp.errors import DeviceError, ProtocolError
from rtcomp.loop.device import OK

pytest.importorskip("odrive_can", reason="the mock is in the package odrive-can")

GROUP = "239.74.163.7"
NODE = 2
MOCK = f"""
import can
from odrive_can.mock import ODriveCANMock
bus = can.Bus(interface="udp_multicast", channel="{GROUP}")
mock = ODriveCANMock({NODE}, bus)
print("there", flush=True)
mock.start()
"""
SETTINGS = {"interface": "udp_multicast", "channel": GROUP}


@pytest.fixture(scope="module")
def mock():
    try:
        CanLink(CanSettings(driver="any", **SETTINGS)).close()
    except DeviceError as error:
        pytest.skip(f"no multicast here: {error}")
    with subprocess.Popen(
        [sys.executable, "-c", MOCK], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdout.readline() == b"there\n"
        yield process
        process.kill()


@pytest.fixture
def link(mock):
    made = OdriveLink(CanSettings(driver="any", **SETTINGS), NODE, "0.6")
    yield made
    made.can.close()


def test_the_handshake(link):
    assert link.listen(5.0).state == IDLE
    assert not link.faulty
    link.close_loop()
    assert link.wait(10.0, lambda: link.beat.state == CLOSED_LOOP)  # it takes half a second over it
    assert link.open_loop(10.0)
    assert link.beat.state == IDLE
    assert link.damaged == 0


def test_it_moves_as_it_is_told(link):
    link.listen(5.0)
    link.send(Command.CONTROLLER_MODE, c.encode_mode(2, c.PASSTHROUGH))  # velocity
    link.send(Command.INPUT_VEL, c.encode_estimates(3.0, 0.0))  # two floats, as estimates are
    assert link.wait(5.0, lambda: link.estimates != b"" and c.decode_estimates(link.estimates)[1] > 2.9)
    first = c.decode_estimates(bytes(link.estimates))[0]
    time.sleep(0.3)
    link.wait(0.3, lambda: False)
    assert c.decode_estimates(link.estimates)[0] > first + 0.5
    link.send(Command.INPUT_VEL, c.encode_estimates(0.0, 0.0))


def test_it_answers_requests_with_zeros_which_is_no_version(link):
    link.listen(5.0)
    assert link.ask(Command.ERROR, 2.0) == bytes(8)
    with pytest.raises(ProtocolError, match=r"firmware 0\.0\.0"):
        link.check_version()


def test_the_whole_driver_on_it(mock, monkeypatch):
    monkeypatch.setattr(OdriveLink, "check_version", lambda _: None)
    settings = {"node_id": NODE, "check_watchdog": False, "watchdog": 2.0, **SETTINGS}
    settings["heartbeat_timeout"] = 5.0  # it closes its loop in half a second, deaf meanwhile
    with create({"driver": "odrive-can", **settings}, Bench(period=0.1)) as device:
        samples = []
        for k in range(20):
            samples.append(device.exchange(0.1 * k))
            time.sleep(0.1)
        assert sum(s.status == OK for s in samples) > 10
        assert device._confirmed
    assert device.disarmed is not None
