"""Ticks that come late and slots that are lost: each is a row, none teaches, none is a false alarm."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_rig import (
    AT,
    TICKS,
    WEIGHTS,
    LateClock,
    device,
    ended_safely,
    go,
    plan,
    replaced,
    stage,
    tick,
)

from rtcomp.errors import LimitError
from rtcomp.loop.device import INVALID, STALE


def test_late_ticks_are_counted_flagged_and_teach_nothing():
    late = {100: 0.3e-3, 200: 0.11e-3, 201: 0.9e-3, 300: 0.09e-3}
    left = go(device(stage()), tick(), plan(TICKS), LateClock(late))
    assert left.outcome.late == 3 and left.outcome.lost == 0 and len(left.rows) == TICKS
    assert np.flatnonzero(left.column("overrun")).tolist() == [100, 200, 201]
    assert left.column("lateness_us")[[100, 200, 201, 300]] == pytest.approx([300, 110, 900, 90])
    learning = left.column("learning")
    # A late sample is neighbour of the two before and after; learning goes on where three stand right.
    frozen = [100, 101, 102, 200, 201, 202, 203]
    assert not learning[frozen].any()
    others = np.setdiff1d(np.arange(2, TICKS), frozen)
    assert learning[others].all()
    assert left.outcome.updates == len(others)
    changed = np.flatnonzero(np.any(np.diff(left.weights, axis=0), axis=1)) + 1
    assert not set(changed) & set(frozen)


@settings(max_examples=25, deadline=None)
@given(st.dictionaries(st.integers(0, 119), st.floats(0.0, 12e-3), max_size=12))
def test_every_slot_has_its_row_whatever_the_clock_does(late):
    clock = LateClock(late)
    left = go(device(stage()), tick(), plan(120), clock)
    assert left.outcome.ticks == len(left.rows) == 120
    assert np.allclose(left.column("time"), 1e-3 * np.arange(120), rtol=0, atol=1e-15)
    assert np.array_equal(left.column("reference"), plan(120).table[:, 0])
    overrun = left.column("overrun")
    assert np.count_nonzero(overrun == 2) == left.outcome.lost
    assert left.outcome.late <= np.count_nonzero(overrun == 1)
    # One exchange for each row that was not lost, and the zero at the end.
    assert left.device.exchanges == 120 - left.outcome.lost + 1
    assert len(clock.asked) == 120 - left.outcome.lost
    assert left.device.calls[-2:] == [("exchange", 0.0), ("close", 0.0)]
    assert np.isfinite(left.rows).all()


def test_a_stall_is_lost_slots_with_the_command_held():
    left = go(device(stage()), tick(), plan(TICKS), LateClock({150: 20.4e-3}))
    assert left.outcome.lost == 20 and left.outcome.ticks == TICKS
    overrun = left.column("overrun")
    assert (overrun[150:170] == 2).all() and overrun[170] == 1 and not overrun[171:].any()
    assert (left.column("voltage")[150:170] == left.column("voltage")[149]).all()
    assert left.column("lateness_us")[150] == pytest.approx(20_400)
    assert not left.column("learning")[150:173].any() and left.column("learning")[173:].all()


def test_late_and_lost_at_the_very_end():
    left = go(device(stage()), tick(), plan(100), LateClock({98: 50e-3}))
    assert left.outcome.ticks == len(left.rows) == 100 and left.outcome.lost == 1


class Jittery:
    """A device that is sampled when the late tick comes, not when it was due; and the clock that is late."""

    def __init__(self, late, share):
        self.delay_ticks = 0
        self.late = late
        self.share = share
        from rtcomp.stage.simulate import Simulator

        self.simulator = Simulator(stage())
        self.number = 0
        self.before = 0.0

    def open(self):
        pass

    def close(self):
        pass

    def exchange(self, volts):
        from rtcomp.loop.device import Sample

        after = self.share * 1e-3 if self.number in self.late else 0.0
        if self.number:
            self.simulator.advance(volts, 1e-3 + after - self.before)
        self.before = after
        self.number += 1
        return Sample(self.simulator.position, self.simulator.time, self.number)

    commands = ()
    calls = ()


def test_samples_taken_late_do_no_harm_to_the_weights():
    """One tick in ten half a period late, sampled late: learned weights stay as good as without."""
    ticks = 4000
    late = set(range(7, ticks, 10))
    clock = LateClock(dict.fromkeys(late, 0.0005))
    punctual = go(Jittery(set(), 0.5), tick(), plan(ticks))
    jittered = go(Jittery(late, 0.5), tick(), plan(ticks), clock)
    assert jittered.outcome.late == len(late)
    error = [np.abs(r.tick.weights[:4] / WEIGHTS - 1).max() for r in (punctual, jittered)]
    assert error[0] < 0.02 and error[1] < 0.03
    # Learning from them would have been seen: the same motion, lateness not told.
    untold = go(Jittery(late, 0.5), tick(), plan(ticks))
    assert np.abs(untold.tick.weights[:4] / WEIGHTS - 1).max() > 3 * error[1]


@pytest.mark.parametrize("status", [STALE, INVALID])
def test_samples_that_are_not_new_teach_nothing_and_do_not_jerk(status):
    held = replaced(position=0.9e-3, status=status)
    left = go(
        device(stage(), wrong=dict.fromkeys(range(200, 205), held)),
        tick(travel=(-1e-3, 1e-3), speed=0.5),
        plan(TICKS),
    )
    ended_safely(left)
    assert not left.column("learning")[200:207].any() and left.column("learning")[207:].all()
    assert np.abs(np.diff(left.column("voltage")))[195:215].max() < 0.5


def test_a_loop_that_is_always_late_still_minds_the_speed():
    always = LateClock(dict.fromkeys(range(TICKS), 0.0003))
    noting = device(stage(), wrong={AT: replaced(position=9e-4)})
    left = go(noting, tick(speed=0.1), plan(TICKS), always, error=LimitError)
    ended_safely(left)
    assert len(left.rows) == AT + 1


def test_a_stall_is_no_false_alarm():
    """What the axis did in slots that were missed is not held against it."""
    left = go(device(stage()), tick(speed=5e-3), plan(TICKS), LateClock(dict.fromkeys((100, 220), 0.0402)))
    assert left.outcome.stopped_by == "end" and left.outcome.lost == 80
