"""Is a sample new, is it possible, does the axis follow: the rule written out, and no false alarms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from loop_rig import CONSTANT, MASS, TablePlan, device, go, plan, stage, tick

from rtcomp.hysteresis.rls import Rls
from rtcomp.loop import layout as at
from rtcomp.loop.checks import is_new, moves

STRICT = {
    "travel": (-1e-3, 1e-3), "speed": 0.5, "jump": 4 * 10 * CONSTANT / MASS * 1e-6, "one_count": 2e-8,
    "stuck_volts": 2.0, "stuck_ticks": 50, "sign_volts": 2.0, "age_ticks": 10, "invalid_ticks": 0,
    "slots_lost": 20, "force_bound": 10 * CONSTANT * 10.0,
}  # fmt: skip
"""Every check on, as sharp as a careful person would set it."""


def new(state, sequence, time):
    row = np.zeros(len(at.COLUMNS))
    row[at.ROW_SEQUENCE], row[at.ROW_DEVICE_TIME] = sequence, time
    return bool(is_new(state, row))


@settings(max_examples=100, deadline=None)
@given(
    st.integers(1, 2**40), st.integers(8, 32), st.lists(st.integers(1, 9), min_size=1, max_size=60),
    st.sampled_from([2.0**32 * 1e-6, 1e9]),
)  # fmt: skip
def test_a_count_and_a_clock_that_run_are_new_also_where_they_wrap_round(first, bits, steps, clock):
    """Counts of 8 to 32 bits, some lost on the way; clocks of 32 bits of microseconds, or without end."""
    state, count, time = np.zeros(at.HISTORY), first, 1e-3 * first
    for step in steps:
        count, time = count + step, time + 1e-3 * step
        wrapped = count % 2**bits
        assume(wrapped != 0)  # a 0 beside a 0 says nothing
        assert new(state, wrapped, time % clock)
    assert state[at.REPEATED] == 0


@settings(max_examples=100, deadline=None)
@given(
    st.integers(200, 2**31),
    st.integers(0, 127),
    st.floats(0.0, 20.0),
    st.sampled_from(["both", "count", "time"]),
)
def test_what_was_seen_before_is_not_new(count, back, ago, has):
    state = np.zeros(at.HISTORY)
    with_count, with_time = has != "time", has != "count"
    assert new(state, count * with_count, (100.0 + 1e-3 * count) * with_time)
    older = (count - back) * with_count, (100.0 + 1e-3 * count - ago) * with_time
    assert not new(state, *older) and not new(state, *older)
    assert state[at.REPEATED] == state[at.REPEATED_RUN] == 2
    assert new(state, (count + 1) * with_count, (200.0 + 1e-3 * count) * with_time)
    assert state[at.REPEATED_RUN] == 0


def test_a_device_that_counts_nothing_cannot_be_seen_to_stand_still():
    state = np.zeros(at.HISTORY)
    assert all(new(state, 0, 0.0) for _ in range(20))


@settings(max_examples=200, deadline=None)
@given(
    st.integers(0, 12), st.floats(-19.0, 19.0), st.floats(-5e-5, 5e-5), st.floats(1.3, 50.0), st.booleans()
)
def test_a_gap_is_judged_by_what_can_happen_in_it(gap, acceleration, speed, beyond, left):
    """Whatever the drive can do in the ticks without a sample passes; what is clearly more does not."""
    limits = np.full(at.FORCE_BOUND + 1, np.inf)
    limits[at.PERIOD], limits[at.JUMP_LIMIT] = 1e-3, 20.0 * 1e-6
    ticks = gap + 1
    for jump, expected in ((0.0, at.OK), (beyond * 20e-6 * ticks * (ticks + 1), at.JUMP)):
        state = np.zeros(at.HISTORY + 3)
        state[at.MEASURED_AT], state[at.MEASURED_SPEED], state[at.SINCE] = 1e-4, speed, gap
        # Discretely: the speed grows by a tick's worth in each of them.
        there = 1e-4 + speed * ticks + acceleration * 1e-6 * ticks * (ticks + 1) / 2
        assert moves(limits, state, there + (jump if left else -jump), False) == expected


@pytest.mark.parametrize("noise", [0.0, 3e-9])
@pytest.mark.parametrize("amplitude", [0.2, 1.0, 8.0])
def test_hard_but_honest_motion_is_no_fault(noise, amplitude):
    """Steps that saturate the drive both ways, rests, slow creeping: every check on, none of them trips."""
    table = plan(3000).table
    t = 1e-3 * np.arange(3000)
    steps = 5e-5 * amplitude * np.sign(np.sin(2 * np.pi * 1.7 * t)) * (t < 1.5) + 2e-6 * (t - 1.5) * (
        t >= 2.0
    )
    table[:, at.REFERENCE] = table[:, at.LEAD_POSITION] = steps
    table[:, at.LEAD_FORCE] = 0.0
    limits = {**STRICT, "jump": 2 * STRICT["jump"]}
    left = go(device(stage(noise=noise)), tick(delay=0, **limits), TablePlan(table))
    assert left.outcome.stopped_by == "end" and left.outcome.diverged == left.outcome.degraded == 0
    if amplitude == 8.0:
        assert np.count_nonzero(np.abs(left.column("voltage")) >= 2.0) > 100  # it was driven hard


def test_at_rest_nothing_is_learned_that_matters():
    """No excitation, no gate, sensor noise only, for a long time: no wind-up, and the weights stay."""
    table = plan(21_000).table
    table[1000:, :3] = table[1000, :3]
    table[1000:, at.LEAD_FORCE] = 0.0
    left = go(device(stage(noise=2e-9)), tick(learner=Rls(0.999), **STRICT), TablePlan(table))
    covariance = left.tick.identifier.ls
    cap = Rls(0.999).vector(left.tick.scales)[2:-2].max()
    assert np.isfinite(covariance).all() and np.abs(covariance).max() <= 1.01 * cap
    before, after = left.weights[1500], left.weights[-1]
    scales = left.tick.scales
    assert np.abs((after - before) * scales).max() < 0.1 * np.abs(before * scales).sum()
    assert left.outcome.diverged == 0
    learning = left.column("learning")
    assert learning[5:1000].all() and not learning[2000:].any()
