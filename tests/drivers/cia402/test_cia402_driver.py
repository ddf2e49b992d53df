"""The driver against the simulated axis on a bus that can be made bad: what it refuses and survives."""

from __future__ import annotations

import struct
import time

import can
import numpy as np
import pytest
from canopen.sdo import SdoClient
from hypothesis import given
from hypothesis import settings as settings_of_hypothesis
from hypothesis import strategies as st
from rtcomp_drivers import cia402
from rtcomp_drivers.cia402_axis import State
from rtcomp_drivers.cia402_objects import EDS, eds_text
from rtcomp_drivers.cia402_settings import Cia402Settings
from rtcomp_drivers.cia402_talk import Talk
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.registry import create

from rtcomp.errors import (
    ConfigError,
    DeviceBusyError,
    DeviceError,
    DeviceTimeoutError,
    ProtocolError,
    RtcompError,
)
from rtcomp.loop.device import OK, STALE


@pytest.fixture
def drive(made):
    return made.axis()


@pytest.fixture
def driver(made, drive):
    return made.driver(drive)


def refused(kind, words, action):
    with pytest.raises(RtcompError) as caught:
        action()
    text = str(caught.value)
    assert type(caught.value) is kind, text
    assert "\n" not in text
    for word in words:
        assert word in text
    return text


def in_vain(**settings):
    """Build a driver whose settings are to be refused before any bus is touched."""
    period = settings.pop("period", 1e-3)
    settings = {"driver": "cia402", "interface": "virtual", "channel": "nobody", "node": 5, **settings}
    return lambda: create(settings, Bench(period=period))


def keep_on(driver, volts=0.0, seconds=5.0):
    """Exchange until it raises, at most so long."""

    def run():
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            driver.exchange(volts)
            time.sleep(1e-3)

    return run


def wait(condition, seconds=5.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_nothing_is_enabled_before_the_first_exchange(driver, drive):
    with driver:
        assert drive.axis.state is State.DISABLED
        driver.exchange(0.5)
        assert drive.axis.state is State.ENABLED
        wait(lambda: drive.axis.output == 0.5)
    assert drive.axis.state is State.DISABLED
    assert drive.axis.output == 0.0
    assert driver.disarmed
    assert not driver.remarks


def test_commands_are_rounded_and_clamped(made, drive):
    driver = made.driver(drive, voltage_limit=2.0)
    with driver:
        driver.exchange(0.12345)
        assert driver.output == pytest.approx(0.123)
        driver.exchange(-700.0)
        assert driver.output == -2.0
        driver.exchange(1e300)
        assert driver.output == 2.0
        assert driver.counters["clamped"] == 2
        driver.exchange(0.0)
        wait(lambda: drive.axis.memory[0x6072] == 2000)  # the drive clamps there too
    assert drive.axis.memory[0x6072] == 10_000  # the next run may have another limit


def test_a_drive_whose_largest_torque_is_nothing(driver, drive):
    drive.axis.memory[0x6072] = 0
    refused(DeviceError, ["6072h", "is 0"], driver.open)


def test_it_closes_so_that_the_drive_misses_nobody(driver, drive):
    with driver:
        driver.exchange(0.1)
    time.sleep(1.3)  # longer than the watchdog
    assert drive.axis.state is State.DISABLED
    assert drive.axis.counters["watchdog_trips"] == 0


def test_a_loop_that_stops_is_given_up_by_the_drive(made, drive):
    driver = made.driver(drive, watchdog=0.2)
    with driver:
        driver.exchange(1.0)
        wait(lambda: drive.axis.output == 1.0)
        wait(lambda: drive.axis.output == 0.0)  # though the program is alive: no thread feeds it
        (zeroing,) = drive.axis.zeroings
        assert zeroing.cause == "watchdog"
        assert zeroing.since_command <= 0.2 + 1e-9
        refused(DeviceError, ["heartbeat of the host lost (8130h)"], keep_on(driver))
    refused(DeviceError, ["fault", "8130h", "clear_fault: true"], driver.open)
    again = made.driver(drive, clear_fault=True)
    with again:
        assert again.exchange(0.0).status == OK
        assert any("8130h" in remark for remark in again.remarks)


def test_missing_samples_are_the_old_one_and_then_the_end(made, drive):
    driver = made.driver(drive, reply_timeout=0.02, max_missed=3)
    with driver:
        for _ in range(5):
            driver.exchange(0.1)
        before = driver.exchange(0.1)
        drive.to_host = lambda frames: [f for f in frames if f.identifier != 0x185]
        samples = [driver.exchange(0.1) for _ in range(3)]
        assert [s.status for s in samples] == [STALE] * 3
        assert {s.position for s in samples} == {before.position}
        refused(DeviceTimeoutError, ["no sample in 4 exchanges"], lambda: driver.exchange(0.1))
        drive.to_host = lambda frames: frames
    assert driver.disarmed


def test_one_sample_in_three_lost_is_survived(driver, drive):
    lost = [0]

    def lossy(frames):
        lost[0] += 1
        return [f for f in frames if f.identifier != 0x185 or lost[0] % 3]

    with driver:
        driver.exchange(0.0)
        driver._timeout = 0.02
        drive.to_host = lossy
        statuses = [driver.exchange(0.1).status for _ in range(60)]
        drive.to_host = lambda frames: frames
    assert STALE in statuses
    assert driver.counters["missed"] == statuses.count(STALE)


def test_a_sample_that_comes_twice_counts_once(driver, drive):
    with driver:
        drive.to_host = lambda frames: [f for f in frames for _ in range(1 + (f.identifier == 0x185))]
        samples = [driver.exchange(0.1) for _ in range(50)]
        drive.to_host = lambda frames: frames
        sequences = [s.sequence for s in samples]
        assert sequences == list(range(sequences[0], sequences[0] + 50))
        assert driver.counters["duplicate"] >= 49
        assert driver.counters["late"] == 0


def test_a_sample_that_comes_late_is_no_duplicate(made, drive):
    driver = made.driver(drive, reply_timeout=0.02)
    held = []

    def one_behind(frames):
        out = [f for f in frames if f.identifier != 0x185]
        for frame in frames:
            if frame.identifier == 0x185:
                held.append(frame)
                if len(held) > 1:
                    out.append(held.pop(0))
        return out

    with driver:
        driver.exchange(0.0)
        drive.to_host = one_behind
        statuses = [driver.exchange(0.5).status for _ in range(10)]
        assert statuses[0] == STALE
        drive.to_host = lambda frames: [held.pop(0), *frames] if held else frames
        driver.exchange(0.5)
        driver.exchange(0.5)
        assert driver.counters["late"] == 1
        assert driver.counters["duplicate"] == 0


@pytest.mark.parametrize(
    ("frame", "says"),
    [
        ((0x085, b"\x10\x23\x03" + bytes(5)), ["emergency", "continuous over-current (2310h)", "current"]),
        ((0x085, b"\x42\xff\x81" + bytes(5)), ["manufacturer (FF42h)", "manufacturer"]),
        ((0x705, b"\x00"), ["was reset"]),
        ((0x705, b"\x7f"), ["is not operational", "7Fh"]),
        ((0x185, b"\x50\x02" + bytes(4)), ["not enabled any more", "switch on disabled"]),
        ((0x185, b"\x18\x02" + bytes(4)), ["not enabled any more", "fault"]),
    ],
)
def test_whatever_ends_being_enabled_ends_the_run(driver, drive, frame, says):
    with driver:
        driver.exchange(0.1)
        drive.put(*frame)
        text = refused(DeviceError, ["drive 5 on CAN interface virtual", *says], keep_on(driver))
        assert refused(DeviceError, says, lambda: driver.exchange(0.0)) == text  # latched
    wait(lambda: drive.axis.output == 0.0)
    assert drive.axis.state is State.DISABLED


def test_an_error_that_has_gone_ends_nothing(driver, drive):
    with driver:
        driver.exchange(0.1)
        drive.put(0x085, bytes(8))
        assert [driver.exchange(0.1).status for _ in range(20)] == [OK] * 20


@pytest.mark.parametrize("frame", [(0x080,), (0x000, b"\x01\x00"), (0x205, bytes(4)), (0x77F, b"\x05")])
def test_another_master_ends_the_run(driver, drive, frame):
    with driver:
        driver.exchange(0.1)
        drive.put(*frame)
        refused(DeviceBusyError, ["another master", f"{frame[0]:03X}h"], keep_on(driver))
    wait(lambda: drive.axis.output == 0.0)


def test_another_master_is_heard_before_anything_is_sent(made, drive):
    first = made.driver(drive)
    first.open()
    task = can.Bus(interface="virtual", channel=drive.channel)
    beat = task.send_periodic(can.Message(arbitration_id=0x80, is_extended_id=False), 0.01)
    heard = drive.axis.counters["sdo_requests"]
    second = made.driver(drive)
    refused(DeviceBusyError, ["another master", "080h"], second.open)
    assert drive.axis.counters["sdo_requests"] == heard
    beat.stop()
    task.shutdown()


def test_a_drive_that_is_enabled_belongs_to_somebody(made, drive):
    first = made.driver(drive)
    with first:
        first.exchange(0.5)
        wait(lambda: drive.axis.output == 0.5)
        second = made.driver(drive)
        refused(DeviceBusyError, ["enabled by another master"], second.open)
        assert drive.axis.output == 0.5  # nobody took anything away from the first


def test_a_node_that_is_not_there(made, drive):
    driver = made.driver(drive, node=6)
    refused(
        DeviceTimeoutError, ["drive 6", "does not answer at 1000000 bit/s", "nodes that do: 5"], driver.open
    )


def test_a_bus_with_nobody_on_it(made, drive):
    drive.end()
    refused(DeviceTimeoutError, ["nor does any other node"], made.driver(drive).open)


def test_a_watchdog_that_the_drive_does_not_keep(driver, drive):
    write = drive.axis.memory.write
    drive.axis.memory.write = lambda i, s, d: 0 if i == 0x1016 else write(i, s, d)
    refused(DeviceError, ["did not keep the watchdog"], driver.open)


def test_a_drive_that_refuses_an_object(driver, drive):
    drive.axis.memory.fix(0x1400, 2, 1)
    drive.axis.memory._entries.pop((0x1017, 0))
    refused(ProtocolError, ["refuses access to 1017h", "subindex does not exist"], driver.open)


def test_a_drive_that_never_becomes_enabled(made, drive):
    driver = made.driver(drive, connect_timeout=0.2)
    drive.axis._obey = lambda controlword: None
    with driver:
        refused(
            DeviceTimeoutError, ["stays in 'switch on disabled'", "torque off"], lambda: driver.exchange(0.0)
        )


def test_a_drive_that_fails_while_being_enabled(driver, drive):
    with driver:
        obey = drive.axis._obey

        def fails(controlword):
            obey(controlword)
            if drive.axis.state is State.ENABLED:
                drive.axis._fail(0x7122, "motor")

        drive.axis._obey = fails
        refused(DeviceError, ["went into fault while being enabled", "7122h"], lambda: driver.exchange(0.0))
        drive.axis._obey = obey


def test_a_bus_that_closes(driver, drive):
    with driver:
        driver.exchange(0.1)
        driver._talk.link.bus.shutdown()
        refused(DeviceError, ["CAN interface virtual"], keep_on(driver))
    assert driver.disarmed is False
    assert any("watchdog must see to it" in remark for remark in driver.remarks)


def test_damaged_frames_are_dropped_and_many_are_the_end(driver, drive):
    with driver:
        driver.exchange(0.1)
        drive.put(0x185, b"\x37\x02\x00")
        assert driver.exchange(0.1).status == OK
        assert driver.counters["bad_frames"] == 1

        def damaged(frames):
            return [f._replace(data=f.data[:5]) if f.identifier == 0x185 else f for f in frames]

        driver._timeout = 0.02
        drive.to_host = damaged
        refused(DeviceError, ["over 10 %"], keep_on(driver))
        drive.to_host = lambda frames: frames


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
    refused(ConfigError, says, in_vain(**settings))


@pytest.mark.parametrize(
    ("section", "says"),
    [
        ("6071", ["no 6071h", "torque mode"]),
        ("6064", ["no 6064h"]),
        ("1A00sub2", ["no 1A00h:2"]),
        ("1016sub1", ["no 1016h:1", "drive_watchdog"]),
        ("6076", ["no 6076h", "rated_torque"]),
    ],
)
def test_an_eds_without_what_is_needed(tmp_path, section, says):
    head, _, rest = eds_text().partition(f"[{section}]\n")
    _, _, rest = rest.partition("\n\n")
    index = section[:4]
    if len(section) == 4:
        head = "\n".join(line for line in head.split("\n") if not line.endswith(f"=0x{index}"))
    path = tmp_path / "without.eds"
    path.write_text(head + rest)
    refused(ConfigError, [str(path), *says], in_vain(eds=str(path)))


def test_an_eds_with_other_types(tmp_path):
    path = tmp_path / "other.eds"
    path.write_text(
        eds_text().replace(
            "Target torque\nObjectType=0x7\nDataType=0x0003", "Target torque\nObjectType=0x7\nDataType=0x0004"
        )
    )
    refused(ConfigError, ["6071h has data type 0004h"], in_vain(eds=str(path)))


@pytest.mark.parametrize("content", [b"", b"\x00\xff" * 50, b"not an eds\n", b"[1000]\nParameterName=x\n"])
def test_files_that_are_no_eds(tmp_path, content):
    path = tmp_path / "broken.eds"
    path.write_bytes(content)
    refused(ConfigError, [str(path)], in_vain(eds=str(path)))
    other = tmp_path / "drive.txt"
    other.write_text(EDS.read_text())
    refused(ConfigError, ["no EDS file"], in_vain(eds=str(other)))


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


class Quiet:
    """A link on which frames are handed over by hand; everything that is sent is taken."""

    who, damaged = "CAN interface of a test", 0

    def send(self, message):
        pass

    def receive(self, seconds):
        return None


@pytest.mark.slow
def test_a_million_random_frames_are_decoded_or_dropped():
    """No crash, and no sample but from a TPDO of the right length that says enabled."""
    rng = np.random.default_rng(402)
    settings = Cia402Settings(driver="cia402", channel="x", node=5)
    counters = dict.fromkeys(
        ("sent", "samples", "bad_frames", "other_frames", "warnings", "late", "duplicate"), 0
    )
    heard = np.array([0x185, 0x085, 0x705, 0x585, 0x80, 0x205])
    ended = taken = 0
    talk = None
    for _ in range(1000):
        drawn = heard[rng.integers(0, len(heard), 1000)]
        drawn = np.where(rng.random(1000) < 0.4, 0x185, drawn)
        identifiers = np.where(rng.random(1000) < 0.9, drawn, rng.integers(0, 0x800, 1000)).tolist()
        lengths = np.where(rng.random(1000) < 0.5, 6, rng.integers(0, 9, 1000)).tolist()
        enabled = (rng.random(1000) < 0.5).tolist()
        data = bytearray(rng.bytes(8000))
        for k in range(1000):
            if talk is None:
                talk = Talk(Quiet(), settings, counters)
                talk.armed = True
            payload = data[8 * k : 8 * k + lengths[k]]
            if enabled[k] and lengths[k]:
                payload[0] = 0x37
            before = counters["samples"]
            message = can.Message(arbitration_id=identifiers[k], data=payload, is_extended_id=False)
            talk.send(0, 0)
            try:
                talk.hear(message)
            except DeviceError as error:
                assert "\n" not in str(error)
                assert counters["samples"] == before
                ended += 1
                talk = None
                continue
            if counters["samples"] != before:
                taken += 1
                assert identifiers[k] == 0x185
                assert lengths[k] == 6
                assert payload[0] & 0x6F == 0x27
                assert talk.last.position == talk.last.position
    assert ended > 10_000
    assert taken > 10_000
