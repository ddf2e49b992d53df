"""The host's end of a bus: who can be opened, what ends in one line, how long it waits."""

from __future__ import annotations

import itertools
import os
import socket
import stat
import threading
import time

import can
import pytest
from held_port import held
from refusals import in_one_line
from rtcomp_drivers import can_link
from rtcomp_drivers.can_link import CanLink, CanSettings, check_interface, check_socketcan, configured
from slcan_pty import Adapter

from rtcomp.errors import ConfigError, DeviceBusyError, DeviceError

_NUMBER = itertools.count()


def link(interface="slcan", channel="x", **settings):
    return CanLink(CanSettings(driver="any", interface=interface, channel=channel, **settings))


@pytest.fixture
def open_link(adapter):
    made = link(channel=adapter.port)
    yield made
    made.close()


def message(identifier=0x29, data=b"\x01\x02", **more):
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=False, **more)


def refused(error_type, *words, **settings):
    return in_one_line(error_type, words, lambda: link(**settings))


def test_frames_go_out_and_come_in(open_link, adapter):
    for length in range(9):
        open_link.send(message(data=bytes(range(length))))
        back = open_link.receive(1.0)
        assert bytes(back.data) == bytes(range(length))
        assert back.arbitration_id == 0x29
        assert not back.is_remote_frame
    open_link.send(message(data=None, is_remote_frame=True, dlc=8))
    back = open_link.receive(1.0)
    assert back.is_remote_frame
    assert back.dlc == 8
    assert open_link.damaged == 0


def test_many_frames_that_came_at_once_come_one_by_one_in_their_order(open_link, adapter):
    for k in range(50):
        open_link.send(message(data=bytes([k])))
    time.sleep(0.1)
    assert [open_link.receive(0.5).data[0] for _ in range(50)] == list(range(50))
    assert open_link.receive(0.0) is None


def test_it_waits_as_long_as_it_is_told(open_link):
    for seconds in (0.0, 0.05, 0.2):
        began = time.monotonic()
        assert open_link.receive(seconds) is None
        assert seconds <= time.monotonic() - began < seconds + 0.5


def test_it_returns_when_a_frame_comes(open_link, adapter):
    threading.Timer(0.1, lambda: os.write(adapter.master, b"t0291AA\r")).start()
    began = time.monotonic()
    assert open_link.receive(5.0).data == b"\xaa"
    assert time.monotonic() - began < 2.0


def test_noise_and_cut_lines_are_dropped_and_counted(open_link, adapter):
    for junk in (b"t0298112233\r", b"\xff\xfe\r", b"t0zz0\r", b"x" * 500 + b"\r", b"t02", b"9111\rt0291A"):
        os.write(adapter.master, junk)
    os.write(adapter.master, b"B\r")
    got = []
    while (frame := open_link.receive(0.2)) is not None:
        got.append(bytes(frame.data))
    assert got == [b"\x11", b"\xab"]
    assert open_link.damaged == 4


def test_what_a_host_that_died_left_on_the_line_is_not_obeyed(adapter):
    fd = os.open(adapter.port, os.O_RDWR | os.O_NOCTTY)
    os.write(fd, b"S5\rO\rt0298AABB")  # at another bit rate, in the middle of a line
    time.sleep(0.1)
    os.close(fd)
    os.write(adapter.master, b"t0291AA\rt0291B")
    made = link(channel=adapter.port)
    assert made.receive(0.05) is None
    made.send(message())
    assert made.receive(1.0).data == b"\x01\x02"
    assert adapter.heard == [(0x29, b"\x01\x02", False, False, 0)]
    made.close()


def test_an_unplugged_adapter_is_an_error_and_closing_it_is_not(adapter):
    made = link(channel=adapter.port)
    adapter.end()
    with pytest.raises(DeviceError, match="has gone") as caught:
        made.receive(1.0)
    assert adapter.port in str(caught.value)
    with pytest.raises(DeviceError, match="has gone"):
        for _ in range(3):
            made.send(message())
    made.close()
    made.close()


def test_an_adapter_that_does_not_read_blocks_nobody(adapter):
    made = link(channel=adapter.port)
    adapter.reads = False
    began = time.monotonic()
    with pytest.raises(DeviceError, match=r"queue is full.*bit rate"):
        for k in range(100_000):
            made.send(message(data=k.to_bytes(4, "big")))
    assert time.monotonic() - began < 10.0
    adapter.reads = True
    time.sleep(0.2)
    made.send(message(data=b"after"))  # what was cut in the middle spoils nothing that follows
    end = time.monotonic() + 5.0
    while not (adapter.heard and adapter.heard[-1].data == b"after") and time.monotonic() < end:
        time.sleep(0.01)
    numbers = [int.from_bytes(f.data, "big") for f in adapter.heard[:-1]]
    assert numbers == list(range(len(numbers)))
    assert adapter.heard[-1].data == b"after"
    assert adapter.adapter.counters["damaged"] <= 1
    made.close()


def test_a_port_that_is_used_already(adapter):
    with held(adapter.port):
        refused(DeviceBusyError, adapter.port, "busy", channel=adapter.port)
    made = link(channel=adapter.port)
    refused(DeviceBusyError, "busy", channel=adapter.port)
    made.close()
    link(channel=adapter.port).close()


def test_channels_that_are_none(tmp_path):
    file = tmp_path / "file"
    file.write_text("kept")
    refused(DeviceError, "does not exist", channel=str(tmp_path / "ttyNone"))
    refused(DeviceError, "not a serial port", channel=str(file))
    refused(DeviceError, "not a serial port", channel="/dev/null")
    assert file.read_text() == "kept"


def test_interfaces_and_bit_rates_that_are_none():
    refused(ConfigError, "'sclan'", "did you mean 'slcan'", interface="sclan")
    refused(ConfigError, "300000", "250000", bitrate=300_000)
    with pytest.raises(ValueError, match="bitrate"):
        CanSettings(driver="x", channel="can0", bitrate=2_000_000)
    check_interface(CanSettings(driver="x", interface="socketcan", channel="can0", bitrate=300_000))


def test_an_interface_whose_own_library_is_missing():
    refused(DeviceError, "pcan", "cannot be opened", interface="pcan", channel="PCAN_USBBUS1")


def test_a_kernel_without_can_says_so(monkeypatch):
    def none(*_):
        raise OSError(97, "Address family not supported by protocol")

    monkeypatch.setattr(socket, "socket", none)
    refused(DeviceError, "AF_CAN", "slcan", interface="socketcan", channel="can0")


@pytest.fixture
def kernel_with_can(monkeypatch, tmp_path):
    """A kernel that has can0, as far as is looked: the socket, /sys, and what `ip` says of it."""

    class Socket:
        def __init__(self, *_):
            pass

        def close(self):
            pass

    (tmp_path / "can0").mkdir()
    monkeypatch.setattr(can_link.socket, "socket", Socket)
    monkeypatch.setattr(can_link, "Path", lambda _, name: tmp_path / name)

    def says(text):
        ip = tmp_path / "ip"
        ip.write_text(f"#!/bin/sh\ncat <<'X'\n{text}\nX\n")
        ip.chmod(ip.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")

    return says


def test_an_interface_that_is_down_or_has_another_bit_rate(kernel_with_can):
    about = '[{"flags":["NOARP"%s],"linkinfo":{"info_data":{"bittiming":{"bitrate":%d}}}}]'
    kernel_with_can(about % (',"UP"', 1_000_000))
    assert configured("can0") == {"up": 1, "bitrate": 1_000_000}
    check_socketcan("can0", 1_000_000)
    with pytest.raises(DeviceError, match=r"1000000 bit/s.*500000.*sudo ip link set can0"):
        check_socketcan("can0", 500_000)
    kernel_with_can(about % ("", 1_000_000))
    with pytest.raises(DeviceError, match="is down; sudo ip link set can0 up type can bitrate 1000000"):
        check_socketcan("can0", 1_000_000)
    with pytest.raises(DeviceError, match=r"can7 does not exist; sudo ip link set can7"):
        check_socketcan("can7", 1_000_000)
    kernel_with_can("no json")
    assert configured("can0") == {}
    check_socketcan("can0", 1_000_000)


def test_the_virtual_bus_of_python_can():
    channel = f"test {next(_NUMBER)}"
    one, other = link("virtual", channel), link("virtual", channel)
    one.send(message())
    assert other.receive(1.0).data == b"\x01\x02"
    began = time.monotonic()
    assert other.receive(0.1) is None
    assert 0.1 <= time.monotonic() - began < 1.0
    one.close()
    other.close()


@pytest.mark.parametrize(
    ("frame", "says"),
    [(can.Message(is_error_frame=True, arbitration_id=0x40), "bus off"), (None, None)],
)
def test_error_frames_are_counted_and_bus_off_is_the_end(frame, says):
    channel = f"test {next(_NUMBER)}"
    one, other = link("virtual", channel), link("virtual", channel)
    one.send(can.Message(is_error_frame=True, arbitration_id=0x04))
    one.send(message())
    assert other.receive(1.0).data == b"\x01\x02"
    assert other.error_frames == 1
    if frame is not None:
        one.send(frame)
        with pytest.raises(DeviceError, match=says):
            other.receive(1.0)
    one.close()
    other.close()


def test_python_can_s_own_multicast_bus():
    try:
        one, other = link("udp_multicast", "239.74.163.2"), link("udp_multicast", "239.74.163.2")
    except DeviceError as error:
        pytest.skip(f"no multicast here: {error}")
    one.send(message(data=b"\x05"))
    assert other.receive(2.0).data == b"\x05"
    assert one.receive(0.1) is None, "its own frame came back"
    other.send(message(data=b"\x05"))
    assert one.receive(2.0).data == b"\x05"
    one.close()
    other.close()


def test_a_host_at_another_bit_rate_hears_nothing():
    other = Adapter(bit_rate=250_000)
    made = link(channel=other.port)
    made.send(message())
    assert made.receive(0.1) is None
    made.close()
    other.end()
