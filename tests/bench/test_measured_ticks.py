"""The rivals of the operator are rivals: they compute the same; round trips over a real pty are counted."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rtcomp_drivers.plant_process import PlantProcess

from rtcomp.bench import link, tick
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-tick.SPAN, tick.SPAN), min_size=2, max_size=80))
def test_all_three_operators_give_one_output(inputs):
    basis, motion = IntervalBasis.over(7, tick.SPAN), np.array(inputs)
    weights = tick.falling(7)
    ours = tick.operator(7, motion)[1]
    for rival in (tick.plain_numpy, tick.plain_python):
        assert rival(basis.widths, weights, motion) == pytest.approx(ours, abs=1e-9 * weights.sum())


def test_ticks_are_timed():
    found = tick.measure(Configuration.load(shipped("leuven.yaml")), ticks=1500)
    assert found.kernel.total == found.with_device.total == 1500
    assert 0.0 < found.kernel.percentile(50.0) < found.with_device.percentile(50.0)
    told = found.to_json()
    assert told["ratios"]["numpy"] == pytest.approx(told["numpy_us"] / told["operator_us"])
    assert told["ratios"]["python"] > 1.0


def test_two_ways_are_timed_by_turns_and_the_first_pairs_left_out():
    calls = []

    def ours():
        calls.append("ours")

    def theirs():
        calls.append("theirs")
        time.sleep(2e-3)

    first, second = link.by_turns(
        ours, theirs, 500.0, link.LEFT_OUT + 10, after=lambda: calls.append("after")
    )
    assert calls == ["ours", "theirs", "after"] * (link.LEFT_OUT + 10)
    assert first.total == second.total == 10
    assert second.values[0] >= 2000.0  # us; a sleep is never shorter


def test_round_trips_of_both_ways_on_one_port():
    """The board sees every command, alternating: none is lost, doubled or out of sequence."""
    with PlantProcess(shipped("leuven.yaml")) as plant:
        found = link.measure(plant.port, 250.0, 0.4, priority=10)
        seen = plant.stop()
    assert found.driver.total == found.raw.total == 100
    assert 0.0 < found.driver.percentile(50.0) <= found.driver.longest
    exchanges = 2 * (100 + link.LEFT_OUT)
    assert seen["commands"] == exchanges + 2  # the first sample, the last zero
    assert seen["discarded"] == seen["superseded"] == seen["bad_frames"] == seen["watchdog_trips"] == 0
    assert found.counters["duplicate"] == found.counters["missed"] == 0
    ratios = found.ratios()
    assert ratios["p50"] == pytest.approx(found.driver.percentile(50.0) / found.raw.percentile(50.0))
