"""The board as a state machine, in virtual time: its output is zero unless armed and fed."""

from __future__ import annotations

import math

import pytest
from free_mass import FreeMass
from hypothesis import given, settings
from hypothesis import strategies as st
from rtcomp_drivers import protocol
from rtcomp_drivers.board import Board, BoardFacts
from rtcomp_drivers.protocol import ARMED, DISARMED, FAULT, encode

WATCHDOG_S = 0.05
LIMIT_V = 5.0


class RememberingMass(FreeMass):
    """Also remembers what it got: begin, end, volts of each stretch."""

    def __init__(self):
        super().__init__()
        self.time = 0.0
        self.stretches: list[tuple[float, float, float]] = []

    def advance(self, volts, seconds):
        assert seconds > 0.0
        super().advance(volts, seconds)
        self.stretches.append((self.time, self.time + seconds, volts))
        self.time += seconds


class Rig:
    """A board with a host that speaks its bytes."""

    def __init__(self, **facts):
        self.plant = RememberingMass()
        self.board = Board(self.plant, BoardFacts(voltage_limit=10.0, **facts))
        self.decoder = protocol.Decoder()
        self.now = 0.0

    def say(self, *messages, wait=1e-3):
        self.now += wait
        return self.raw(b"".join(encode(m) for m in messages))

    def raw(self, data):
        return self.decoder.feed(self.board.receive(data, self.now))

    def wait(self, seconds):
        self.now += seconds
        return self.decoder.feed(self.board.run_until(self.now))

    def arm(self, watchdog=WATCHDOG_S, limit=LIMIT_V):
        self.say(protocol.Hello(1))
        (reply,) = self.say(arm_request(watchdog, limit))
        assert reply == protocol.Reply(9, protocol.ACCEPTED, ARMED, protocol.NO_FAULT)
        return self


def arm_request(watchdog=WATCHDOG_S, limit=LIMIT_V, period=1e-3):
    return protocol.Arm(9, round(1e3 * watchdog), round(1e6 * limit), round(1e6 * period))


def volts(sequence, value):
    return protocol.Command(sequence, round(1e6 * value))


def test_it_says_who_it_is():
    (info,) = Rig(axis="rotary", text="here").say(protocol.Hello(77))
    assert info == protocol.Info(
        77, protocol.VERSION, protocol.ROTARY, DISARMED, 0, 20_000, 10_000_000, 1e-12, "here"
    )


def test_not_armed_it_measures_but_does_not_act():
    rig = Rig()
    (sample,) = rig.say(volts(1, 3.0))
    assert sample.flags == protocol.IGNORED
    assert sample.state == DISARMED
    rig.wait(1.0)
    assert rig.plant.position == 0.0


def test_a_sample_is_taken_before_its_command_takes_effect():
    rig = Rig().arm()
    (first,) = rig.say(volts(1, 2.0))
    (second,) = rig.say(volts(2, -2.0), wait=0.01)
    assert (first.position, first.output_uv) == (0, 0)
    assert second.position == round(0.5 * 2.0 * 0.01**2 / 1e-12)
    assert second.output_uv == 2_000_000
    assert second.time_us - first.time_us == 10_000
    assert second.sequence == 2


@pytest.mark.parametrize(
    ("wanted", "given_limit", "applied"), [(7.0, 5.0, 5.0), (-7.0, 5.0, -5.0), (70.0, 50.0, 10.0)]
)
def test_commands_are_clamped_to_the_lower_limit(wanted, given_limit, applied):
    rig = Rig().arm(limit=given_limit)
    (sample,) = rig.say(volts(1, wanted))
    assert sample.flags == protocol.CLAMPED
    assert rig.board.output == applied
    (sample,) = rig.say(volts(2, applied))
    assert sample.flags == 0


def test_the_watchdog_acts_at_its_instant_however_late_it_is_looked_at():
    rig = Rig().arm()
    rig.say(volts(1, 1.0))
    fed = rig.now
    (fault,) = rig.wait(10.0)
    assert fault.fault == protocol.WATCHDOG
    assert fault.time_us == round(1e6 * (fed + WATCHDOG_S))
    assert rig.plant.velocity == pytest.approx(WATCHDOG_S, rel=1e-12)
    (zeroing,) = rig.board.zeroings
    assert zeroing.time == pytest.approx(fed + WATCHDOG_S)
    assert zeroing.noticed_after == pytest.approx(10.0 - WATCHDOG_S)


def test_a_command_that_comes_after_the_watchdog_is_not_acted_on():
    rig = Rig().arm()
    rig.say(volts(1, 1.0))
    fault, sample = rig.say(volts(2, 1.0), wait=WATCHDOG_S)
    assert fault.fault == protocol.WATCHDOG
    assert (sample.state, sample.flags) == (FAULT, protocol.IGNORED)
    assert rig.board.output == 0.0


def test_a_fault_stays_until_it_is_cleared():
    rig = Rig().arm()
    rig.wait(1.0)
    assert rig.say(arm_request())[0].result == protocol.WRONG_STATE
    assert rig.say(protocol.Disarm(4))[0] == protocol.Reply(4, protocol.ACCEPTED, FAULT, protocol.WATCHDOG)
    assert rig.say(protocol.Hello(1))[0].state == FAULT
    assert rig.say(protocol.Clear(5))[0] == protocol.Reply(5, protocol.ACCEPTED, DISARMED, 0)
    assert rig.say(arm_request())[0].result == protocol.ACCEPTED


def test_arming_again_is_the_same_request_or_refused():
    rig = Rig().arm()
    assert rig.say(arm_request())[0].result == protocol.ACCEPTED  # its reply may have been lost
    assert rig.say(arm_request(limit=10.0))[0].result == protocol.WRONG_STATE
    assert rig.say(protocol.Clear(2))[0].result == protocol.WRONG_STATE
    assert rig.board.state == ARMED


def test_asking_to_arm_again_does_not_feed_the_watchdog():
    rig = Rig().arm()
    for _ in range(4):
        replies = rig.say(arm_request(), wait=0.4 * WATCHDOG_S)
    assert rig.board.state == FAULT
    assert replies[-1].result == protocol.WRONG_STATE


@pytest.mark.parametrize(
    "request_",
    [
        arm_request(watchdog=0.0),
        arm_request(watchdog=11.0),
        arm_request(limit=0.0),
        arm_request(period=0.0),
        arm_request(period=1e-5),
    ],
)
def test_it_does_not_arm_with_parameters_out_of_range(request_):
    rig = Rig()
    assert rig.say(request_)[0].result == protocol.BAD_PARAMETER
    assert rig.board.state == DISARMED


def test_duplicates_and_old_commands_do_nothing():
    rig = Rig().arm()
    rig.say(volts(5, 1.0))
    assert rig.say(volts(5, 2.0), volts(4, 3.0)) == []
    assert rig.board.output == 1.0
    assert rig.board.counters["discarded"] == 2
    rig.wait(WATCHDOG_S - 1e-3)
    assert rig.board.state == FAULT  # they did not feed it either


def test_sequences_wrap():
    rig = Rig().arm()
    start = 0x7FFFFFFF
    for k in range(4):
        (sample,) = rig.say(volts((start + k * 0x40000000) & 0xFFFFFFFF, 1.0))
    assert sample.sequence == 0x3FFFFFFF
    assert rig.board.counters["discarded"] == 0


def test_of_commands_that_piled_up_only_the_newest_counts():
    rig = Rig().arm()
    samples = rig.say(*[volts(k, 0.1 * k) for k in range(1, 31)])
    assert [s.sequence for s in samples] == [30]
    assert rig.board.output == pytest.approx(3.0)
    assert rig.board.counters["superseded"] == 29


def test_zero_and_disarm_in_one_go():
    rig = Rig().arm()
    rig.say(volts(1, 1.0))
    sample, reply = rig.say(volts(2, 0.0), protocol.Disarm(3))
    assert sample.state == ARMED
    assert reply == protocol.Reply(3, protocol.ACCEPTED, DISARMED, 0)
    assert [z.cause for z in rig.board.zeroings] == ["disarmed"]


def test_a_hello_disturbs_no_session():
    rig = Rig().arm()
    rig.say(volts(5, 1.0))
    (info,) = rig.say(protocol.Hello(1))
    assert info.state == ARMED
    assert rig.say(volts(5, 2.0)) == []
    assert rig.board.output == 1.0


@pytest.mark.parametrize("position", [math.nan, math.inf, 1e7])
def test_a_position_that_is_none_ends_in_fault(position):
    rig = Rig().arm()
    rig.say(volts(1, 1.0))
    rig.plant.measure = lambda: position
    sample, fault = rig.say(volts(2, 1.0))
    assert sample.flags & protocol.POSITION_INVALID
    assert sample.state == FAULT
    assert fault.fault == protocol.SENSOR
    assert rig.board.output == 0.0


def test_a_bad_link_ends_in_fault_when_armed_only():
    rig = Rig()
    for _ in range(50):
        rig.raw(b"\x07garbage\0")
    assert rig.board.state == DISARMED
    rig.now += 1.0
    rig.arm()
    sequence = 0
    while rig.board.state == ARMED and sequence < 100:
        sequence += 1
        rig.say(volts(sequence, 1.0))
        rig.raw(b"\x07garbage\0")
    assert rig.board.fault == protocol.LINK
    assert rig.board.output == 0.0
    assert sequence < 20


def test_ending_the_board_zeroes_the_output():
    rig = Rig().arm()
    rig.say(volts(1, 1.0))
    rig.board.shut_down(rig.now + 0.01)
    assert rig.board.output == 0.0
    assert rig.board.zeroings[-1].cause == "shut down"


acts = st.one_of(
    st.tuples(st.just("wait"), st.floats(1e-6, 3 * WATCHDOG_S)),
    st.tuples(st.just("command"), st.floats(-20.0, 20.0)),
    st.tuples(st.just("repeated command"), st.floats(-20.0, 20.0)),
    st.tuples(st.just("damaged command"), st.floats(-20.0, 20.0)),
    st.tuples(st.just("garbage"), st.binary(max_size=40)),
    st.tuples(st.just("arm"), st.none()),
    st.tuples(st.just("disarm"), st.none()),
    st.tuples(st.just("clear"), st.none()),
    st.tuples(st.just("hello"), st.none()),
)


@settings(deadline=None, max_examples=150)
@given(st.lists(acts, max_size=60))
def test_whatever_a_host_does_the_output_is_zero_unless_armed_and_fed(script):
    """Judged by what the plant got, against a model of three lines: who was armed, when fed, with what."""
    rig = Rig()
    sequence = 1000
    since_hello = False
    allowed = [(0.0, 0.0, 0.0)]  # from when, until when, which voltage
    for act, value in [("hello", None), ("arm", None), ("command", 1.0), *script, ("wait", 1.0)]:
        rig.now += 1e-3
        armed_before = rig.board.state == ARMED and rig.now < allowed[-1][1]
        if act == "wait":
            rig.wait(value)
        elif act == "command":
            since_hello = True
            sequence += 1
            rig.raw(encode(volts(sequence, value)))
            if armed_before and rig.board.state == ARMED:
                applied = min(max(round(1e6 * value), -5_000_000), 5_000_000) / 1e6
                allowed.append((rig.now, rig.now + WATCHDOG_S, applied))
        elif act == "repeated command":
            if since_hello:  # a new session may begin its count anywhere
                rig.raw(encode(volts(sequence, value)))
        elif act == "damaged command":
            frame = bytearray(encode(volts(sequence + 1, value)))
            frame[4] ^= 0x40
            rig.raw(bytes(frame) + b"\0")
        elif act == "garbage":
            rig.raw(value + b"\0")
        elif act == "arm":
            (reply,) = [m for m in rig.raw(encode(arm_request())) if isinstance(m, protocol.Reply)]
            if reply.result == protocol.ACCEPTED and not armed_before:
                allowed.append((rig.now, rig.now + WATCHDOG_S, 0.0))
        elif act == "disarm":
            rig.raw(encode(protocol.Disarm(1)))
            allowed.append((rig.now, rig.now, 0.0))
        elif act == "clear":
            rig.raw(encode(protocol.Clear(1)))
        else:
            since_hello = False
            rig.raw(encode(protocol.Hello(1)))
    for begin, end, got in rig.plant.stretches:
        if got != 0.0:
            since, until, wanted = [a for a in allowed if a[0] <= begin + 1e-9][-1]
            assert got == wanted
            assert since - 1e-9 <= begin
            assert end <= until + 1e-9
