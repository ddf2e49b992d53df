"""The driver and the simulated axis on a bus that can be made bad: what ends a run, what it survives."""

from __future__ import annotations

import time

import pytest
from refusals import in_one_line
from rtcomp_drivers.cia402_axis import State
from waiting import keep_on, wait

from rtcomp.errors import DeviceBusyError, DeviceError, DeviceTimeoutError
from rtcomp.loop.device import OK, STALE


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
        in_one_line(DeviceError, ["heartbeat of the host lost (8130h)"], keep_on(driver))
    in_one_line(DeviceError, ["fault", "8130h", "clear_fault: true"], driver.open)
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
        in_one_line(DeviceTimeoutError, ["no sample in 4 exchanges"], lambda: driver.exchange(0.1))
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
        text = in_one_line(DeviceError, ["drive 5 on CAN interface virtual", *says], keep_on(driver))
        assert in_one_line(DeviceError, says, lambda: driver.exchange(0.0)) == text  # latched
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
        in_one_line(DeviceBusyError, ["another master", f"{frame[0]:03X}h"], keep_on(driver))
    wait(lambda: drive.axis.output == 0.0)


def test_a_drive_that_never_becomes_enabled(made, drive):
    driver = made.driver(drive, connect_timeout=0.2)
    drive.axis._obey = lambda controlword: None
    with driver:
        in_one_line(
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
        in_one_line(
            DeviceError, ["went into fault while being enabled", "7122h"], lambda: driver.exchange(0.0)
        )
        drive.axis._obey = obey


def test_a_bus_that_closes(driver, drive):
    with driver:
        driver.exchange(0.1)
        driver._talk.link.bus.shutdown()
        in_one_line(DeviceError, ["CAN interface virtual"], keep_on(driver))
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
        in_one_line(DeviceError, ["over 10 %"], keep_on(driver))
        drive.to_host = lambda frames: frames
