"""An ODrive's axis in virtual time: every edge of its states, its watchdog, what it says and puts out."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rtcomp_drivers import cansimple as c
from rtcomp_drivers.cansimple import CLOSED_LOOP, IDLE, Command
from rtcomp_drivers.odrive_axis import AxisFacts, OdriveAxis, odrive_side
from rtcomp_drivers.slcan import Frame, encode

NODE = 5
BOTH = pytest.mark.parametrize("dialect", c.DIALECTS)


class Mass:
    """1 kg, 1 N/V; remembers what it was given."""

    def __init__(self):
        self.position = self.velocity = 0.0
        self.given = []

    def advance(self, volts, seconds):
        self.given.append((volts, seconds))
        self.position += self.velocity * seconds + 0.5 * volts * seconds**2
        self.velocity += volts * seconds

    def measure(self):
        return self.position


def make(dialect="0.6", **facts):
    return OdriveAxis(Mass(), AxisFacts(node=NODE, dialect=dialect, **facts))


def frame(command, data=b"", node=NODE):
    return Frame(c.identifier(node, command), data)


def poll(command, node=NODE):
    return Frame(c.identifier(node, command), b"", True, False, 8)


MODE = frame(Command.CONTROLLER_MODE, c.encode_mode())
CLOSE = frame(Command.AXIS_STATE, c.encode_state(CLOSED_LOOP))
OPEN = frame(Command.AXIS_STATE, c.encode_state(IDLE))
ESTOP = frame(Command.ESTOP)


def torque(nm):
    return frame(Command.INPUT_TORQUE, c.encode_torque(nm))


def clear(dialect="0.6"):
    return frame(Command.CLEAR_ERRORS, c.encode_clear(dialect))


def closed(dialect="0.6", **facts):
    axis = make(dialect, **facts)
    axis.receive([MODE, torque(0.0), CLOSE], 0.0)
    assert axis.state == CLOSED_LOOP
    return axis


def test_it_closes_its_loop_in_torque_control_only_and_acts_on_torque():
    axis = make()
    axis.receive([CLOSE], 0.0)
    assert (axis.state, axis.result) == (IDLE, c.INVALID_STATE_RESULT)
    axis.receive([MODE, torque(0.5)], 0.0)
    assert axis.torque == 0.0
    axis.receive([CLOSE], 0.0)
    assert axis.torque == 0.5  # as in the firmware the input is kept: a host must zero it first
    axis.receive([torque(-0.25)], 0.01)
    axis.receive([OPEN], 0.02)
    assert axis.torque == 0.0
    assert [v for v, _ in axis.plant.given] == [0.5, -0.25]
    assert [z.cause for z in axis.zeroings] == ["disarmed"]


@BOTH
def test_its_watchdog_acts_at_its_own_instant(dialect):
    axis = closed(dialect, watchdog=0.1)
    axis.receive([torque(0.5)], 0.05)
    axis.run_until(1.0)
    assert axis.state == IDLE
    (zeroing,) = axis.zeroings
    assert zeroing.cause == "watchdog"
    assert zeroing.time == pytest.approx(0.15)
    assert zeroing.since_command == pytest.approx(0.1)
    assert zeroing.noticed_after == pytest.approx(0.85)
    assert sum(s for v, s in axis.plant.given if v) == pytest.approx(0.1)
    assert c.error_names(axis.error, dialect) == "WATCHDOG_TIMER_EXPIRED"
    axis.receive([CLOSE], 1.0)
    assert axis.state == IDLE
    axis.receive([clear(dialect), CLOSE], 1.0)
    assert axis.state == CLOSED_LOOP


def test_the_watchdog_of_0_5_6_runs_while_idle_and_that_of_0_6_does_not():
    new, old, without = make(), make("0.5.6"), make("0.5.6", watchdog=None)
    for axis in (new, old, without):
        axis.run_until(10.0)
    assert (new.error, without.error) == (0, 0)
    assert c.error_names(old.error, "0.5.6") == "WATCHDOG_TIMER_EXPIRED"
    assert old.counters["watchdog_trips"] == 1


@pytest.mark.parametrize("fed", [poll(Command.ENCODER_ESTIMATES), torque(0.1), MODE, frame(0x1A, bytes(4))])
def test_any_frame_to_the_node_feeds_the_watchdog_and_none_to_another_does(fed):
    axis, other = closed(), closed()
    for k in range(1, 20):
        axis.receive([fed], 0.05 * k)
        other.receive([fed._replace(identifier=fed.identifier + 32)], 0.05 * k)
    assert axis.state == CLOSED_LOOP
    assert other.state == IDLE


@BOTH
def test_an_emergency_stop_is_latched(dialect):
    axis = closed(dialect)
    axis.receive([torque(0.5), ESTOP], 0.01)
    assert (axis.state, axis.torque) == (IDLE, 0.0)
    assert "ESTOP_REQUESTED" in c.error_names(axis.error, dialect)
    axis.receive([CLOSE, torque(0.5)], 0.02)
    assert axis.torque == 0.0
    axis.receive([clear(dialect)], 0.03)
    assert (axis.state, axis.error) == (IDLE, 0)


@BOTH
@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_a_torque_that_is_no_number_is_an_error(dialect, number):
    axis = closed(dialect)
    axis.receive([torque(0.5)], 0.01)
    axis.receive([torque(number)], 0.02)
    assert (axis.state, axis.torque) == (IDLE, 0.0)
    assert axis.error
    assert all(math.isfinite(v) for v, _ in axis.plant.given)


def test_torque_is_clamped_and_cut_frames_are_ignored():
    axis = closed(torque_limit=0.3)
    axis.receive([torque(9.0)], 0.01)
    assert axis.torque == 0.3
    axis.receive([frame(Command.INPUT_TORQUE, b"\0\0\0\0"), frame(Command.CONTROLLER_MODE, b"\0")], 0.02)
    assert axis.torque == 0.3
    assert axis.counters["ignored"] == 2
    assert axis.counters["clamped"] == 1


def test_out_of_torque_control_it_puts_out_nothing():
    axis = closed()
    axis.receive([torque(0.5)], 0.01)
    axis.receive([frame(Command.CONTROLLER_MODE, c.encode_mode(3, c.PASSTHROUGH))], 0.02)
    assert axis.torque == 0.0
    axis.receive([MODE], 0.03)
    assert axis.torque == 0.5


def test_states_that_it_does_not_have_are_refused():
    for state in (0, 2, 3, 4, 6, 7, 99):
        new, old = make(), make("0.5.6")
        for axis in (new, old):
            axis.receive([MODE, frame(Command.AXIS_STATE, c.encode_state(state))], 0.0)
            assert axis.state == IDLE
        assert (new.result, new.error) == (c.INVALID_STATE_RESULT, 0)
        assert c.error_names(old.error, "0.5.6") == "INVALID_STATE"


def test_it_answers_what_it_is_asked_in_its_order():
    axis = make(turn=2.0)
    axis.plant.position = 3.0
    sent = axis.receive([poll(Command.VERSION), poll(Command.ENCODER_ESTIMATES), poll(Command.ERROR)], 0.0)
    assert [s.identifier & 31 for s in sent] == [Command.VERSION, Command.ENCODER_ESTIMATES, Command.ERROR]
    assert c.decode_version(sent[0].data).firmware == (0, 6, 10)
    assert c.decode_estimates(sent[1].data) == (1.5, 0.0)
    assert c.decode_two_numbers(sent[2].data) == (0, 0)
    assert make("0.5.6").receive([poll(Command.VERSION), poll(Command.ERROR)], 0.0) == []
    assert axis.receive([poll(Command.VERSION, node=6), poll(0x1C)], 0.0) == []


def test_the_position_is_measured_before_the_torque_acts_and_the_speed_is_the_mean():
    axis = closed()
    axis.receive([torque(1.0)], 0.0)
    (one,) = axis.receive([poll(Command.ENCODER_ESTIMATES), torque(0.0)], 0.05)
    (two,) = axis.receive([poll(Command.ENCODER_ESTIMATES)], 0.06)
    turn = 2.0 * math.pi
    first, second = c.decode_estimates(one.data), c.decode_estimates(two.data)
    assert first[0] * turn == pytest.approx(0.5 * 0.05**2, rel=1e-6)
    assert second[1] * turn == pytest.approx(0.05, rel=1e-4)


@BOTH
def test_heartbeats_come_on_their_grid_and_are_not_made_up_for(dialect):
    axis = make(dialect, watchdog=None)
    times = []
    for k in range(1, 1001):
        for sent in axis.run_until(1e-3 * k):
            assert c.decode_heartbeat(sent.data, dialect).state == IDLE
            times.append(axis.time)
    assert times == pytest.approx([0.1 * k for k in range(1, 11)], abs=2e-3)
    assert len(axis.run_until(5.05)) == 1
    assert len(axis.run_until(5.09)) == 0
    assert len(axis.run_until(5.101)) == 1


def test_estimates_may_come_unasked():
    axis = make(estimates=0.01)
    sent = [f for k in range(1, 101) for f in axis.run_until(1e-3 * k)]
    assert sum(f.identifier & 31 == Command.ENCODER_ESTIMATES for f in sent) == 10


frames = st.one_of(
    st.sampled_from([MODE, CLOSE, OPEN, ESTOP, clear(), clear("0.5.6"), poll(Command.ENCODER_ESTIMATES)]),
    st.floats(width=32).map(torque),
    st.builds(
        Frame,
        st.one_of(st.integers(0, 31).map(lambda k: c.identifier(NODE, k)), st.integers(0, 0x7FF)),
        st.binary(max_size=8),
        st.booleans(),
        st.booleans(),
    ),
)
steps = st.lists(st.tuples(st.lists(frames, max_size=4), st.floats(0.0, 0.2)), max_size=25)


@BOTH
@settings(deadline=None)
@given(steps=steps)
def test_whatever_comes_the_output_is_zero_but_in_closed_loop_fed_and_without_error(dialect, steps):
    axis = make(dialect, watchdog=0.1, torque_limit=0.7)
    now = fed = 0.0
    for arriving, pause in steps:
        before = axis.state
        now += pause
        for sent in axis.receive(arriving, now):
            assert sent.identifier >> 5 == NODE
            assert len(sent.data) == 8
            assert not sent.remote
        if any(f.identifier >> 5 == NODE and not f.extended for f in arriving):
            fed = now
        assert abs(axis.torque) <= 0.7
        assert axis.state in (IDLE, CLOSED_LOOP)
        if axis.state == CLOSED_LOOP:
            assert axis.error == 0
            assert now - fed < 0.1 + 1e-9
            asked = any(f.data == c.encode_state(CLOSED_LOOP) for f in arriving)
            assert before == CLOSED_LOOP or asked
        else:
            assert axis.torque == 0.0
    axis.run_until(now + 0.1 + 1e-6)
    assert axis.torque == 0.0
    axis.shut_down(now + 1.0)
    assert all(math.isfinite(v) and abs(v) <= 0.7 for v, _ in axis.plant.given)
    assert axis.time == pytest.approx(sum(s for _, s in axis.plant.given))


@pytest.mark.slow
def test_ten_million_frames_of_anything():
    """Any identifier, any data, many at a time: no crash, and never a torque that nobody may have."""
    import random

    noise = random.Random(3)
    axis = make(watchdog=0.1, torque_limit=0.5)
    now = 0.0
    sane = [MODE, CLOSE, torque(0.4), clear(), poll(Command.ENCODER_ESTIMATES)]
    closed_for = 0
    for _ in range(100_000):
        batch = [
            Frame(
                c.identifier(NODE, noise.getrandbits(5)) if noise.getrandbits(1) else noise.getrandbits(11),
                noise.randbytes(noise.choice((0, 4, 8, 8, 8))),
                not noise.getrandbits(3),
            )
            for _ in range(99)
        ]
        batch.append(noise.choice(sane))
        now += noise.random() * 1e-3
        axis.receive(batch, now)
        closed_for += axis.state == CLOSED_LOOP
        if noise.random() < 0.2:
            axis.receive(sane, now)
        assert abs(axis.torque) <= 0.5
        assert axis.state == CLOSED_LOOP or axis.torque == 0.0
    assert closed_for > 100
    assert axis.counters["zeroed"] > 100


def test_behind_its_adapter_it_is_a_drive_on_a_stage(stage):
    from rtcomp.stage.simulate import Simulator

    side = odrive_side(Simulator(stage), stage)
    assert side.receive(b"S8\rO\r", 0.0) == b"\r\r"
    facts = side.axis.facts
    assert facts.torque_limit * facts.volts_per_torque == pytest.approx(stage.voltage_limit)
    # 2 pi torque / lead is the force: as much as the stage's force constant gives for that voltage
    assert 2 * math.pi * 1.0 / facts.turn == pytest.approx(facts.volts_per_torque * stage.force_constant)
    answer = side.receive(encode(Frame(0x000 | Command.VERSION, b"", True, False, 8)), 0.01)
    assert answer.startswith(b"z\rt0008")
    side.shut_down(0.02)
    assert side.summary()["polls"] == 1
