"""What the driver refuses before anything is enabled: settings, drives, buses, other masters."""

from __future__ import annotations

import itertools
import struct
import time

import can
import pytest
from canopen.sdo import SdoClient
from drives_on_a_bus import in_vain
from hypothesis import given
from hypothesis import settings as settings_of_hypothesis
from hypothesis import strategies as st
from refusals import in_one_line
from rtcomp_drivers import cia402
from waiting import wait

from rtcomp.errors import (
    ConfigError,
    DeviceBusyError,
    DeviceError,
    DeviceTimeoutError,
    ProtocolError,
    RtcompError,
)
from rtcomp.loop.device import OK


def test_a_drive_whose_largest_torque_is_nothing(driver, drive):
    drive.axis.memory[0x6072] = 0
    in_one_line(DeviceError, ["6072h", "is 0"], driver.open)


def test_another_master_is_heard_before_anything_is_sent(made, drive):
    first = made.driver(drive)
    first.open()
    task = can.Bus(interface="virtual", channel=drive.channel)
    beat = task.send_periodic(can.Message(arbitration_id=0x80, is_extended_id=False), 0.01)
    heard = drive.axis.counters["sdo_requests"]
    second = made.driver(drive)
    in_one_line(DeviceBusyError, ["another master", "080h"], second.open)
    assert drive.axis.counters["sdo_requests"] == heard
    beat.stop()
    task.shutdown()


def test_a_drive_that_is_enabled_belongs_to_somebody(made, drive):
    first = made.driver(drive)
    with first:
        first.exchange(0.5)
        wait(lambda: drive.axis.output == 0.5)
        second = made.driver(drive)
        in_one_line(DeviceBusyError, ["enabled by another master"], second.open)
        assert drive.axis.output == 0.5  # nobody took anything away from the first


def test_a_node_that_is_not_there(made, drive):
    driver = made.driver(drive, node=6)
    in_one_line(
        DeviceTimeoutError, ["drive 6", "does not answer at 1000000 bit/s", "nodes that do: 5"], driver.open
    )


def slow(late, delay):
    """Deliver the samples number `late` (a condition) after `delay` s."""
    seen = itertools.count()

    def to_host(frames):
        if any(frame.identifier == 0x185 for frame in frames) and late(next(seen)):
            time.sleep(delay)
        return frames

    return to_host


def test_a_link_whose_every_sample_comes_too_late(made, drive):
    drive.to_host = slow(lambda number: True, 0.015)
    driver = made.driver(drive, reply_timeout=0.01, connect_timeout=0.5)
    in_one_line(DeviceError, ["answers SYNC after 1", "waits 10 ms", "reply_timeout"], driver.open)


def test_a_computer_that_is_busy_at_first_is_no_slow_link(made, drive):
    drive.to_host = slow(lambda number: number < 20, 0.015)
    driver = made.driver(drive, reply_timeout=0.01)
    with driver:
        assert driver.exchange(0.0).status == OK


def test_a_bus_with_nobody_on_it(made, drive):
    drive.end()
    in_one_line(DeviceTimeoutError, ["nor does any other node"], made.driver(drive).open)


def test_a_watchdog_that_the_drive_does_not_keep(driver, drive):
    write = drive.axis.memory.write
    drive.axis.memory.write = lambda i, s, d: 0 if i == 0x1016 else write(i, s, d)
    in_one_line(DeviceError, ["did not keep the watchdog"], driver.open)


def test_a_drive_that_refuses_an_object(driver, drive):
    drive.axis.memory.fix(0x1400, 2, 1)
    drive.axis.memory._entries.pop((0x1017, 0))
    in_one_line(ProtocolError, ["refuses access to 1017h", "subindex does not exist"], driver.open)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"bitrate": 250_000}, ["250000 bit/s", "500000"]),
        ({"bitrate": 1_000_000, "period": 2e-4}, ["5000 Hz"]),
        ({"watchdog": 0.005, "period": 2e-3}, ["watchdog", "three periods (0.006 s)"]),
        ({"host_node": 5}, ["host_node: is 5"]),
        ({"interface": "socketcam"}, ["socketcam", "socketcan"]),
        ({"eds": "no/such.eds"}, ["no/such.eds does not exist"]),
        ({"node": 0}, ["node"]),
        ({"node": 128}, ["node"]),
        ({"baud": 1}, ["baud"]),
        ({"mode": "speed"}, ["mode"]),
    ],
)
def test_settings_that_cannot_be(settings, says):
    in_one_line(ConfigError, says, in_vain(**settings))


class Babbling:
    """A link to something that answers every SDO request with whatever it likes."""

    who, damaged, latency_timer_ms = "CAN interface of a test", 0, None

    def __init__(self, answers):
        self._answers = iter(answers)
        self._next = None

    def send(self, message):
        if message.arbitration_id == 0x605:
            self._next = next(self._answers, None)

    def receive(self, seconds):
        data, self._next = self._next, None
        if data is None:
            time.sleep(min(seconds, 1e-3))
            return None
        return can.Message(arbitration_id=0x585, data=data, is_extended_id=False)

    def close(self):
        pass


def plausible(head, index, sub, value):
    return struct.pack("<BHBI", head, index, sub, value)


@settings_of_hypothesis(max_examples=150, deadline=None)
@given(
    answers=st.lists(
        st.one_of(
            st.binary(min_size=8, max_size=8),
            st.binary(max_size=8),
            st.builds(
                plausible,
                st.sampled_from([0x40, 0x41, 0x42, 0x43, 0x47, 0x4B, 0x4F, 0x60, 0x80, 0x00, 0x01, 0x10]),
                st.sampled_from([0x1000, 0x6041, 0x1008, 0x60A8, 0x6502]),
                st.sampled_from([0, 1]),
                st.sampled_from([402, 0x50, 0x00020192, 5, 1 << 31, 0x06020000]),
            ),
        ),
        max_size=12,
    )
)
def test_whatever_answers_sdo_is_refused_in_one_line(answers):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            cia402, "CanLink", lambda settings: Babbling([plausible(0x43, 0x1000, 0, 402), *answers])
        )
        patch.setattr(cia402, "_LISTEN_S", 0.0)
        patch.setattr(SdoClient, "RESPONSE_TIMEOUT", 0.003)
        device = in_vain()()
        with pytest.raises(RtcompError) as caught:
            device.open()
        assert "\n" not in str(caught.value)
