"""Plans: what the tick is told of each tick, from a reference and from voltages."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp.jobs.plan import ReferencePlan, VoltagePlan
from rtcomp.loop.tick import (
    FEEDFORWARD,
    KNOWN,
    LEAD_FORCE,
    LEAD_POSITION,
    LEARN,
    LET_GO,
    PLAN_WIDTH,
    REFERENCE,
    VOLTS,
)
from rtcomp.stage.balance import known_force


def planned(config, **more):
    reference = config.reference("compensate")
    return reference, ReferencePlan(reference, config.stage, config.period, 2000, **more)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_the_feedforward_is_led_to_where_the_command_acts(leuven, delay):
    """A command of tick k, held for a period after `delay` ticks, acts at (k + delay + 1/2) periods."""
    reference, plan = planned(leuven, delay_ticks=delay)
    rows = plan.rows(0, 2000)
    t = 1e-3 * np.arange(2000)
    assert np.array_equal(rows[:, REFERENCE], reference.evaluate(t)[0])
    acts = t + (delay + 0.5) * 1e-3
    x, v, a = reference.evaluate(acts)
    assert np.allclose(rows[:, LEAD_POSITION], x, rtol=0, atol=1e-15)
    micro = 250.0 * np.exp(-((v / 5e-3) ** 2)) * v
    assert np.allclose(rows[:, LEAD_FORCE], 2.0 * a + 8.0 * v + micro, rtol=0, atol=1e-12)


def test_known_forces_are_those_of_the_tick_before_without_viscous(leuven):
    reference, plan = planned(leuven)
    rows = plan.rows(0, 500)
    before = 1e-3 * (np.arange(500) - 1)
    x, v, _ = reference.evaluate(before)
    known = known_force(leuven.stage, before, x, v, viscous=False)
    assert known.any() and np.allclose(rows[:, KNOWN], known, rtol=0, atol=1e-13)


def test_rows_come_in_any_pieces(leuven):
    _, plan = planned(leuven, learn=(0.3, 0.9), feedforward_from=0.5, feedforward_fade=0.2)
    whole = plan.rows(0, 2000)
    pieces = np.vstack([plan.rows(a, b - a) for a, b in ((0, 1), (1, 700), (700, 2000))])
    assert whole.shape == (2000, PLAN_WIDTH)
    assert np.allclose(pieces, whole, rtol=0, atol=1e-14)


def test_learning_and_feedforward_keep_to_their_times(leuven):
    _, plan = planned(leuven, learn=(0.3, 0.9), feedforward_from=0.5, feedforward_fade=0.2)
    rows = plan.rows(0, 2000)
    t = 1e-3 * np.arange(2000)
    assert np.array_equal(rows[:, LEARN] > 0, (t >= 0.3) & (t <= 0.9))
    share = rows[:, FEEDFORWARD]
    assert not share[t < 0.5].any() and (share[t >= 0.7 + 1e-9] == 1.0).all()
    assert (np.diff(share) >= 0).all() and np.diff(share).max() < 0.01
    at_once = planned(leuven, feedforward_from=0.5)[1].rows(0, 2000)[:, FEEDFORWARD]
    assert np.array_equal(at_once, (t >= 0.5).astype(float))
    assert not planned(leuven)[1].rows(0, 2000)[:, [FEEDFORWARD, LEARN]].any()


def test_an_axis_is_let_go_at_the_end_and_not_before(leuven):
    _, plan = planned(leuven, let_go=0.3)
    taken = plan.rows(0, 2000)[:, LET_GO]
    assert not taken[:1700].any() and taken[1750:].all()
    assert (np.diff(taken) >= 0.0).all() and np.diff(taken).max() < 0.01 and taken[-1] > 0.999
    assert not planned(leuven)[1].rows(0, 2000)[:, LET_GO].any()


def test_voltages_as_they_are(leuven):
    volts = np.random.default_rng(0).normal(0.0, 1.0, 100)
    known, reference = np.arange(100.0), -np.arange(100.0)
    plan = VoltagePlan(volts, 1e-3, known, reference, (0.02, 0.05))
    rows = plan.rows(10, 50)
    assert plan.ticks == 100
    assert np.array_equal(rows[:, VOLTS], volts[10:60])
    assert np.array_equal(rows[:, KNOWN], known[10:60])
    assert np.array_equal(rows[:, REFERENCE], reference[10:60])
    t = 1e-3 * np.arange(10, 60)
    assert np.array_equal(rows[:, LEARN] > 0, (t >= 0.02) & (t <= 0.05))
