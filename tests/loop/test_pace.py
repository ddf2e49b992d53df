"""Missed deadlines in virtual time: counted, degraded, a fault; the same arithmetic as on a wall clock."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_rig import WEIGHTS, LateClock, device, go, plan, stage, tick

from rtcomp.control.pid import INTEGRAL
from rtcomp.errors import DeviceError
from rtcomp.loop import layout as at
from rtcomp.loop.kernel import hand_over, put_aside
from rtcomp.loop.pace import keep_pace, lose_slot
from rtcomp.loop.states import Machine, State

TICKS = 900
LATE = 0.6e-3
RIGHT = np.append(WEIGHTS, 0.0)
RUNNING, DEGRADED = float(State.RUNNING), float(State.DEGRADED)


def compensated(late, ticks=TICKS, **limits):
    return go(
        device(stage()), tick(weights=RIGHT, **limits), plan(ticks, learn=False, share=1.0), LateClock(late)
    )


def degraded(left):
    return np.flatnonzero(left.column("state") == DEGRADED)


def test_one_late_tick_is_counted_and_changes_nothing_else():
    quiet, late = compensated({}), compensated({300: LATE})
    assert late.outcome.late == 1 and late.outcome.degraded == 0
    assert np.array_equal(late.column("voltage"), quiet.column("voltage"))
    assert not late.column("learning").any()
    learning = go(device(stage()), tick(), plan(TICKS), LateClock({300: LATE}))
    assert not learning.column("learning")[300] and learning.column("learning")[298]


@pytest.mark.parametrize(
    ("late", "first"),
    [
        ({300: LATE, 301: LATE, 302: LATE}, 302),
        (dict.fromkeys(range(300, 332, 4), LATE), 328),
        ({300: 1.0e-3}, 300),
    ],
    ids=["three in a row", "eight of 32", "a slot lost"],
)
def test_what_degrades_and_for_how_long(late, first):
    left = compensated(late)
    last = max(late) + (1 if first == 300 else 0)  # the tick that is served after a lost slot is in time
    rows = degraded(left)
    assert rows[0] == first and left.outcome.degraded == 1
    # 32 clean ticks: the 32nd is running again.
    assert rows[-1] == last + (30 if first == 300 else 31) and len(rows) == rows[-1] - first + 1
    served = rows[left.column("overrun")[rows] != 2]
    assert not left.column("feedforward")[served].any()
    assert left.column("feedback")[served].any()


@pytest.mark.parametrize(
    "late",
    [{300: LATE, 301: LATE, 303: LATE, 304: LATE}, dict.fromkeys(range(300, 600, 5), LATE), {300: 0.99e-3}],
    ids=["two in a row, twice", "six or seven of 32", "nearly a slot"],
)
def test_what_does_not_degrade(late):
    left = compensated(late)
    assert left.outcome.degraded == 0 and not len(degraded(left))


def test_feedforward_goes_and_comes_back_without_a_jump():
    late = {400: LATE, 401: LATE, 402: LATE}
    quiet, left = compensated({}, 1800), compensated(late, 1800)
    steps, usual = np.abs(np.diff(left.column("voltage"))), np.abs(np.diff(quiet.column("voltage"))).max()
    feedforward = np.abs(quiet.column("feedforward")[380:460]).max()
    assert feedforward > 10 * usual  # cut off, it would have jumped by so much
    assert steps[395:].max() < 3 * usual
    back = left.column("feedforward")[434 : 434 + 40] / quiet.column("feedforward")[434 : 434 + 40]
    assert (
        np.all(np.diff(back) > -1e-9) and back[0] == pytest.approx(at.FADE) and back[-1] == pytest.approx(1.0)
    )
    error = np.abs(left.column("reference") - left.column("position"))
    usual = np.abs(quiet.column("reference") - quiet.column("position"))
    assert error[1500:].max() < 2 * usual[1500:].max()


def test_a_gap_spoils_the_moment_of_the_gap_and_not_what_follows():
    """Slots lost anywhere in the motion, at reversals too: the integral gives back what it took, no more."""
    gaps = {400 + 131 * k: 1.2e-3 for k in range(70)}
    left = compensated(gaps, 10000)
    feedback_alone = go(device(stage()), tick(weights=RIGHT), plan(10000, learn=False))
    assert left.outcome.degraded == len(gaps)
    errors = [of.column("reference") - of.column("position") for of in (left, feedback_alone)]
    with_gaps, alone = (np.sqrt(np.mean(error[400:] ** 2)) for error in errors)
    assert with_gaps < 0.3 * alone, (with_gaps, alone)


def handed(c, state, share):
    """One tick of the share of feedforward; the integral after it."""
    state[at.SHARE] = share
    c.pid_s[INTEGRAL] = hand_over(c, state, 1.0)
    state[at.LAST_SHARE] = share
    return c.pid_s[INTEGRAL]


@settings(max_examples=100, deadline=None)
@given(
    st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.lists(st.floats(-0.05, 0.05), max_size=40),
    st.integers(0, 16), st.floats(-1.0, 1.0),
)  # fmt: skip
def test_the_integral_gives_back_what_it_took_and_no_more(own, given_up, gained, until, given_again):
    """Also where feedforward goes off again before it has come back altogether."""
    one = tick()
    c, state = one.compensator, one.state
    c.pid_s[INTEGRAL], state[at.HANDED] = own, given_up
    assert handed(c, state, 0.0) == pytest.approx(own + given_up)  # no jump of the command
    for step in gained:
        c.pid_s[INTEGRAL] += step
        handed(c, state, 0.0)
    carried = given_up + sum(gained)
    for k in range(1, until + 1):
        assert handed(c, state, k / 16) == pytest.approx(own + carried * (1 - k / 16), abs=1e-12)
    if 0 < until < 16:
        state[at.HANDED] = given_again
        assert handed(c, state, 0.0) == pytest.approx(own + carried * (1 - until / 16) + given_again)
    for k in range(1 if until < 16 else 17, 17):
        handed(c, state, k / 16)
    assert c.pid_s[INTEGRAL] == pytest.approx(own, abs=1e-12)


def test_a_model_that_was_put_aside_comes_back_slowly_and_takes_from_the_integral_what_it_brings():
    """So that the command stays where it is, however rough the model is by now."""
    one = tick()
    c, state = one.compensator, one.state
    state[at.HANDED], state[at.MODE] = 0.4, RUNNING
    put_aside(one.identifier, state)
    keep_pace(state, 0)
    assert state[at.MODE] == DEGRADED and handed(c, state, 0.0) == pytest.approx(0.4)
    state[at.HELD], state[at.MODE], brings = 0.0, RUNNING, -0.7
    for k in range(1, 129):
        keep_pace(state, 0)
        assert state[at.SHARE] == pytest.approx(k / 128)
        c.pid_s[INTEGRAL] = hand_over(c, state, brings)
        state[at.LAST_SHARE] = state[at.SHARE]
        assert c.pid_s[INTEGRAL] + state[at.SHARE] * brings == pytest.approx(0.4)


def test_once_it_has_come_back_a_gap_is_a_gap_again():
    left = go(
        device(stage()), tick(weights=RIGHT), plan(TICKS, learn=False, share=1.0), LateClock({300: 1.2e-3})
    )
    assert left.tick.state[at.CHANGED] == 0.0
    begun = tick(weights=RIGHT)
    begun.state[at.CHANGED] = 1.0
    left = go(device(stage()), begun, plan(TICKS, learn=False, share=1.0), LateClock({300: 1.2e-3}))
    back = np.flatnonzero(np.diff((left.column("state") == DEGRADED).astype(int)) == -1)[0] + 1
    quiet = compensated({})
    assert left.column("feedforward")[back + 17] == pytest.approx(
        quiet.column("feedforward")[back + 17], rel=1e-3
    )


@pytest.mark.parametrize("at_once", [True, False])
def test_too_many_slots_lost_is_a_latched_fault_at_zero_volts(at_once):
    late = {300: 20.3e-3} if at_once else {300 + 40 * k: 5.3e-3 for k in range(5)}
    noting, machine = device(stage()), Machine()
    left = go(noting, tick(slots_lost=20), plan(TICKS), LateClock(late), error=DeviceError, machine=machine)
    assert "20 slots lost at tick" in str(left.outcome) and "rtcomp doctor" in str(left.outcome)
    assert machine.state is State.FAULT and machine.why == str(left.outcome)
    assert noting.commands[-1] == 0.0 and noting.calls[-1] == ("close", 0.0)
    assert np.count_nonzero(left.column("overrun") == 2) == (20 if at_once else 25)
    assert left.column("state")[-1] == State.FAULT


def test_on_what_is_no_hardware_lost_slots_may_be_counted_only():
    late = {300: 40.3e-3}
    stand_in, real = device(stage()).inner, device(stage())
    left = go(stand_in, tick(slots_lost=20), plan(TICKS), LateClock(late), spare_stand_ins=True)
    assert left.outcome.lost == 40 and left.outcome.stopped_by == "end" and left.outcome.degraded == 1
    go(real, tick(slots_lost=20), plan(TICKS), LateClock(late), error=DeviceError, spare_stand_ins=True)


def test_one_slot_in_a_hundred_may_be_lost_for_ever():
    rare = {50 + 110 * k: 1.2e-3 for k in range(60)}
    left = go(device(stage()), tick(slots_lost=20), plan(7000), LateClock(rare))
    assert left.outcome.lost == 60 and left.outcome.stopped_by == "end"
    often = {50 + 50 * k: 1.2e-3 for k in range(60)}
    left = go(device(stage()), tick(slots_lost=20), plan(7000), LateClock(often), error=DeviceError)
    assert 20 <= np.count_nonzero(left.column("overrun") == 2) <= 45


def test_where_the_device_sets_the_pace_only_samples_that_do_not_come_are_late():
    late = dict.fromkeys(range(300, 320), LATE)
    left = compensated(late, device_paced=True)
    assert left.outcome.late == 20 and left.outcome.degraded == 0
    stale = {k: (lambda s: s._replace(status=1)) for k in (300, 301, 302)}
    left = go(
        device(stage(), wrong=stale),
        tick(weights=RIGHT, device_paced=True),
        plan(TICKS, share=1.0, learn=False),
    )
    assert degraded(left)[0] == 302 and left.outcome.degraded == 1
    host = go(device(stage(), wrong=stale), tick(weights=RIGHT), plan(TICKS, share=1.0, learn=False))
    assert host.outcome.degraded == 0


class Written:
    """The policy as the page says it, with lists."""

    def __init__(self, most):
        self.history, self.lost, self.most = [], 0.0, most
        self.mode, self.fault = State.RUNNING, False

    def slot(self, late, lost):
        self.history.append(late or lost)
        if lost:
            self.lost += 1.0
            self.fault |= self.lost >= self.most
        elif not late:
            self.lost = max(0.0, self.lost - at.FORGIVE)
        recent = self.history[-32:]
        if lost or (all(self.history[-3:]) and len(self.history) >= 3) or sum(recent) >= 8:
            self.mode = State.DEGRADED
        elif self.mode is State.DEGRADED and len(recent) == 32 and not any(recent):
            self.mode = State.RUNNING


@settings(max_examples=200, deadline=None)
@given(st.lists(st.sampled_from("....l.x"), min_size=1, max_size=300), st.sampled_from([5, 20]))
def test_the_pace_is_the_one_written_down(slots, most):
    state, limits = np.zeros(at.HISTORY), np.zeros(at.FORCE_BOUND + 1)
    state[at.MODE], state[at.SHARE], limits[at.SLOTS_LOST] = RUNNING, 1.0, most
    written = Written(most)
    for slot in slots:
        written.slot(slot == "l", slot == "x")
        if slot == "x":
            lose_slot(limits, state)
        else:
            keep_pace(state, int(slot == "l"))
        assert (state[at.FAULT] != 0) == written.fault
        assert state[at.MODE] == (State.FAULT if written.fault else written.mode)
        if written.fault:
            return
        assert (state[at.SHARE] == 0.0) or state[at.MODE] == RUNNING
        assert state[at.LATE_SUM] == sum(written.history[-32:])
