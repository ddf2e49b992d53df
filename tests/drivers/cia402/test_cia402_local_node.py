"""The driver against canopen's LocalNode: objects, SDO, NMT and PDOs that this project did not write."""

from __future__ import annotations

import itertools
import math

import pytest
from rtcomp_drivers.cia402_objects import EDS
from rtcomp_drivers.driver import Bench
from waiting import keep_on

from rtcomp.errors import ConfigError, DeviceBusyError, DeviceError
from rtcomp.loop.device import OK
from rtcomp.stage.stage import Stage

ROTARY = {
    "stage": {"axis": "rotary", "mass": 1e-3, "force_constant": 0.1, "voltage_limit": 2.0, "viscous": 1e-3},
    "rate": 1000.0,
}
OF_E35 = {"counts_per_turn": 2000.0, "drive_watchdog": False}
"""The drive has no 1016h and counts increments of its encoder."""


def bench():
    return Bench(stage=Stage.from_dict(ROTARY), period=1e-3)


@pytest.fixture
def bought(made, e35):
    return made.local(e35)


@pytest.fixture
def driver(made, bought, e35):
    return made.driver(bought, bench(), eds=str(e35), **OF_E35)


def test_it_moves_a_bought_drive(driver, bought):
    with driver:
        assert bought.state != "OPERATION ENABLED"
        samples = [driver.exchange(0.5) for _ in range(200)]
        assert bought.state == "OPERATION ENABLED"
        assert bought.mode == 10
        assert all(s.status == OK for s in samples)
        assert all(b.sequence == a.sequence + 1 for a, b in itertools.pairwise(samples))
        moved = samples[-1].position - samples[0].position
        assert moved == pytest.approx((200 - 2) * 1000 * 2.0 * math.pi / 2000, rel=0.01)
    assert bought.state == "SWITCH ON DISABLED"
    assert bought.node.nmt.state == "PRE-OPERATIONAL"
    # 6076h says 310 mN m: 0.5 V are 50 mN m, 161 thousandths of it
    assert set(bought.torques) == {0, 161}
    assert driver.disarmed


def test_what_was_set_up_stands_in_its_objects(driver, bought):
    with driver:
        sdo = bought.node.sdo
        assert sdo[0x1800][1].raw == 0x40000185
        assert sdo[0x1800][3].raw == 0  # 100 ms of inhibit time, as it comes, would be the end of a loop
        assert sdo[0x1017].raw == 500
        assert sdo[0x6072].raw == math.ceil(1000 * 2.0 * 0.1 / 0.31)
        for index in (0x1801, 0x1802, 0x1803, 0x1401, 0x1402, 0x1403):
            assert sdo[index][1].raw >> 31  # turned off
        assert (sdo[0x60C2][1].raw, sdo[0x60C2][2].raw) == (1, -3)
    assert any("without watchdog" in remark for remark in driver.remarks)
    assert bought.node.sdo[0x1017].raw == 0


def test_a_drive_without_watchdog_is_refused_unless_told(made, bought, e35):
    with pytest.raises(ConfigError, match=r"1016h:1.*drive_watchdog"):
        made.driver(bought, bench(), eds=str(e35), counts_per_turn=2000.0)


def test_counts_that_nobody_explains_are_refused(made, bought, e35):
    driver = made.driver(bought, bench(), eds=str(e35), drive_watchdog=False)
    with pytest.raises(ConfigError, match="counts_per_turn"):
        driver.open()


def test_profile_torque_mode_where_asked(made, bought, e35):
    driver = made.driver(bought, bench(), eds=str(e35), mode="profile", **OF_E35)
    with driver:
        driver.exchange(0.1)
        assert bought.mode == 4
        assert bought.node.sdo[0x6087].raw == 0x7FFFFFFF


def test_a_second_master_is_refused(driver, bought):
    bought.state = "OPERATION ENABLED"
    with pytest.raises(DeviceBusyError, match="another master"):
        driver.open()
    assert bought.state == "OPERATION ENABLED"  # nobody touched it


def test_a_drive_in_fault_says_why_and_is_reset_where_told(made, driver, bought, e35):
    bought.state = "FAULT"
    with pytest.raises(DeviceError, match=r"continuous over-current \(2310h\).*clear_fault"):
        driver.open()
    assert bought.state == "FAULT"
    told = made.driver(bought, bench(), eds=str(e35), clear_fault=True, **OF_E35)
    with told:
        assert told.exchange(0.0).status == OK
    assert any("2310h" in remark for remark in told.remarks)


def test_an_emergency_while_running(driver, bought):
    with driver:
        driver.exchange(0.1)
        bought.fail(0x3210)
        with pytest.raises(DeviceError, match=r"DC link over-voltage \(3210h\).*generic, current"):
            for _ in range(100):
                driver.exchange(0.1)
        with pytest.raises(DeviceError, match="3210h"):  # latched: it is not enabled again
            driver.exchange(0.0)
    assert bought.state == "FAULT"


def test_a_drive_that_leaves_by_itself(driver, bought):
    with driver:
        driver.exchange(0.1)
        bought.state = "SWITCH ON DISABLED"
        with pytest.raises(DeviceError, match="switch on disabled"):
            for _ in range(10):
                driver.exchange(0.1)
        with pytest.raises(DeviceError, match="switch on disabled"):
            driver.exchange(0.0)
    assert bought.state == "SWITCH ON DISABLED"


def test_a_heartbeat_that_stays_away(driver, bought):
    with driver:
        driver.exchange(0.0)
        bought.node.nmt.stop_heartbeat()
        driver._beat_patience = 0.2
        with pytest.raises(DeviceError, match="heartbeat was lost"):
            keep_on(driver)()
    assert bought.state == "SWITCH ON DISABLED"


def test_another_profile_is_refused(made, e35):
    encoder = made.local(e35, values=[(0x1000, 0, 0x00020196)])
    driver = made.driver(encoder, bench(), eds=str(e35), **OF_E35)
    with pytest.raises(DeviceError, match="profile 406"):
        driver.open()


def test_a_drive_without_torque_mode_is_refused(made, e35):
    positioner = made.local(e35, values=[(0x6502, 0, 0x1)])
    driver = made.driver(positioner, bench(), eds=str(e35), **OF_E35)
    with pytest.raises(DeviceError, match=r"6502h, 1h.*torque"):
        driver.open()


def test_a_mode_that_it_does_not_take_is_refused(made, bought, driver):
    bought.node.add_read_callback(lambda index, subindex, od: 1 if index == 0x6061 else None)
    bought.node._read_callbacks.reverse()
    with pytest.raises(DeviceError, match="shows mode 1"):
        driver.open()


def test_positions_go_on_where_its_32_bits_wrap(driver, bought):
    bought.position, bought.step = (1 << 31) - 5000, 1000
    with driver:
        positions = [driver.exchange(0.5).position for _ in range(50)]
    steps = [b - a for a, b in itertools.pairwise(positions)]
    assert all(0.0 <= s <= 1001 * 2.0 * math.pi / 2000 for s in steps)
    assert bought.position > 1 << 31


def test_our_own_eds_on_their_node(made):
    drive = made.local(EDS, values=[(0x60A8, 0, 0xF7010000)])
    driver = made.driver(drive, Bench(period=1e-3))
    with driver:
        assert [driver.exchange(0.2).status for _ in range(20)] == [OK] * 20
        assert drive.node.sdo[0x1016][1].raw == 127 << 16 | 1000
        assert drive.node.sdo[0x6007].raw == 1
    assert drive.node.sdo[0x1016][1].raw == 0  # watches over nobody that is not there any more
    assert drive.torques[-1] == 200  # rated torque is 1 N m


@pytest.mark.parametrize(
    ("unit", "axis", "more", "says"),
    [
        (0xF7010000, "rotary", {}, "the stage is rotary"),
        (0x00100000, "linear", {}, "the stage is linear"),
        (0xF7010000, "linear", {"count_size": 1e-6}, "60A8h"),
        (0x00B50000, "linear", {"counts_per_turn": 4096.0}, "linear: set count_size"),
    ],
)
def test_other_units_than_the_stage_has_are_refused(made, unit, axis, more, says):
    drive = made.local(EDS, values=[(0x60A8, 0, unit)])
    stage = Stage.from_dict({**ROTARY, "stage": {**ROTARY["stage"], "axis": axis}})
    driver = made.driver(drive, Bench(stage=stage, period=1e-3), **more)
    with pytest.raises((DeviceError, ConfigError), match=says) as caught:
        driver.open()
    assert "\n" not in str(caught.value)
    assert drive.state == "SWITCH ON DISABLED"


def test_a_rated_torque_that_is_not_the_drives_is_refused(made):
    drive = made.local(EDS, values=[(0x60A8, 0, 0xF7010000)])
    driver = made.driver(drive, rated_torque=3.0)
    with pytest.raises(ConfigError, match=r"rated_torque is 3 N m.*says 1 "):
        driver.open()
