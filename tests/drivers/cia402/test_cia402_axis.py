"""The simulated axis in virtual time: zero unless enabled, a watchdog at its own instant, CiA 301's rules."""

from __future__ import annotations

import math

import pytest
from axis_in_virtual_time import BEAT, NODE, PRE, RESET, STOP, SYNC, Host
from hypothesis import given
from hypothesis import strategies as st
from rtcomp_drivers.cia402_states import State, state_of
from rtcomp_drivers.slcan import Frame


def test_it_boots_once_into_pre_operational():
    host = Host()
    assert host.heard == [Frame(0x700 + NODE, b"\0")]
    host.let(10.0)
    assert len(host.heard) == 1
    host.send(SYNC)
    assert len(host.heard) == 1  # no PDOs before it is started


def test_torque_becomes_volts_where_it_is_enabled():
    host = Host(voltage_limit=8.0, peak=4.0)  # rated torque is that of 2 V
    host.enable()
    host.command(0x0F, 500)
    assert host.axis.output == pytest.approx(1.0)
    host.command(0x0F, -32768)
    assert host.axis.output == -8.0
    assert host.axis.counters["clamped"] == 1


def test_a_sample_is_from_before_its_own_command():
    host = Host()
    host.enable()
    host.command(0x0F, 1000)
    host.send(BEAT)
    host.let(0.05)
    position = host.axis.plant.position
    word, counts = host.command(0x00, 0)
    assert counts == round(position / 1e-9)
    assert state_of(word) is State.ENABLED
    assert host.axis.state is State.DISABLED
    assert host.axis.output == 0.0


@given(
    watchdog=st.integers(1, 2000),
    before=st.floats(0.0, 0.9),
    looks=st.lists(st.floats(0.01, 1.0), max_size=5),
)
def test_the_watchdog_acts_at_its_own_instant(watchdog, before, looks):
    host = Host()
    host.enable(watchdog)
    host.let(1e-3 * watchdog * before)
    host.send(BEAT)
    host.command(0x0F, 700)
    began = host.now
    trips = began + 1e-3 * watchdog
    for seconds in looks:
        host.let(seconds * 1e-3 * watchdog)
    velocity_before = host.axis.plant.velocity
    host.let(2e-3 * watchdog)
    (zeroing,) = host.axis.zeroings
    assert zeroing.cause == "watchdog"
    assert zeroing.time == pytest.approx(trips)
    assert zeroing.since_command == pytest.approx(1e-3 * watchdog)
    assert host.axis.state is State.FAULT
    # 0.7 V held exactly for the watchdog's time, whenever anybody looked
    assert host.axis.plant.velocity == pytest.approx(0.7 * 1e-3 * watchdog, rel=1e-6, abs=1e-12)
    assert velocity_before <= host.axis.plant.velocity + 1e-12
    emergencies = [f for f in host.heard if f.identifier == 0x80 + NODE]
    assert [f.data[:3] for f in emergencies] == [b"\x30\x81\x11"]


@given(gaps=st.lists(st.floats(0.0, 0.099), max_size=30))
def test_a_host_that_beats_in_time_is_not_given_up(gaps):
    host = Host()
    host.enable(100)
    for gap in gaps:
        host.let(gap)
        host.send(BEAT)
    assert host.axis.state is State.ENABLED


@pytest.mark.parametrize(
    ("option", "state"),
    [(0, State.ENABLED), (1, State.FAULT), (2, State.DISABLED), (3, State.QUICK_STOP)],
)
def test_what_is_to_happen_without_host_is_a_setting(option, state):
    host = Host()
    host.write(0x6007, 0, option, 2)
    host.enable(50)
    host.command(0x0F, 300)
    host.let(0.2)
    assert host.axis.state is state
    assert (host.axis.output == 0.0) == (state is not State.ENABLED)


def test_commands_without_a_heartbeat_do_not_feed_it():
    host = Host()
    host.enable(100)
    for _ in range(20):
        host.command(0x0F, 10)
        host.let(0.01)
    assert host.axis.state is State.FAULT


def test_a_fault_is_latched_until_a_rising_edge():
    host = Host()
    host.enable()
    host.heard += host.axis.fail(0x2310, host.now)
    for _ in range(3):
        host.command(0x0F, 100)
        assert host.axis.state is State.FAULT
    assert host.read(0x603F) == b"\x10\x23"
    assert host.read(0x1003, 1)[:2] == b"\x10\x23"
    host.command(0x80)
    assert host.axis.state is State.DISABLED
    assert host.read(0x603F) == b"\0\0"
    assert Frame(0x80 + NODE, bytes(8)) in host.heard


def test_a_bit_that_stays_up_resets_no_later_fault():
    host = Host()
    host.enable()
    host.command(0x8F)
    host.axis.fail(0x2310, host.now)
    for _ in range(3):
        host.command(0x8F)
    assert host.axis.state is State.FAULT


@pytest.mark.parametrize("frame", [STOP, PRE, RESET, Frame(0, b"\x82\x00")])
def test_leaving_operational_zeroes(frame):
    host = Host()
    host.enable()
    host.command(0x0F, 300)
    assert host.axis.output > 0.0
    host.send(frame)
    assert host.axis.output == 0.0
    assert host.axis.state is State.DISABLED


def test_a_sensor_that_fails_is_a_fault():
    host = Host()
    host.enable()
    host.command(0x0F, 300)
    host.axis.plant.measure = lambda: math.nan
    answer = host.send(SYNC)
    assert host.axis.state is State.FAULT
    assert host.axis.output == 0.0
    assert any(f.identifier == 0x80 + NODE and f.data[:2] == b"\x00\x73" for f in answer)


def test_a_short_rpdo_is_not_acted_on():
    host = Host()
    host.enable()
    host.command(0x0F, 300)
    before = host.axis.output
    answer = host.send(Frame(0x200 + NODE, b"\x0f\x00\x00"), SYNC)
    assert host.axis.output == before
    assert any(f.identifier == 0x80 + NODE and f.data[:2] == b"\x10\x82" for f in answer)


def test_heartbeats_come_at_the_time_set():
    host = Host()
    host.write(0x1017, 0, 100, 2)
    host.let(1.05)
    beats = [f for f in host.heard[1:] if f.identifier == 0x700 + NODE]
    assert beats == [Frame(0x700 + NODE, b"\x7f")] * 10
    host.write(0x1017, 0, 0, 2)
    host.heard.clear()
    host.let(1.0)
    assert host.heard == []


def test_profile_torque_mode_keeps_to_its_slope():
    host = Host(voltage_limit=10.0, peak=10.0)
    host.enable(0)
    host.write(0x6060, 0, 4, 1)
    host.write(0x6087, 0, 1000, 4)  # 1000 thousandths, 1 V, a second
    host.let(0.1)
    host.command(0x0F, 500)
    assert host.axis.output == pytest.approx(0.1)
    host.let(1.0)
    host.command(0x0F, 500)
    assert host.axis.output == pytest.approx(0.5)
