"""What a demonstration hides, and that the circle closes: hidden, named, compensated again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtcomp.circle import demonstrate as d
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.identify import identify
from rtcomp.report.circle_page import circle_rows, judged, with_circle
from rtcomp.report.page import Page, render_page

SCALE = d.Scale(level=5.0, stroke=3e-4, speed=2e-3, force_constant=4.0)


@pytest.fixture(scope="module")
def leuven():
    return Configuration.load(Path(__file__).parents[2] / "configs" / "leuven.yaml")


@pytest.fixture(scope="module")
def model(leuven):
    return identify(leuven).model


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_a_seed_hides_one_effect_that_a_stage_takes(seed):
    stage = Configuration.load(Path(__file__).parents[2] / "configs" / "leuven.yaml").stage
    hidden = d.draw(seed, SCALE)
    assert hidden == d.draw(seed, SCALE)
    plant = d.with_effect(stage, hidden)
    assert len(plant.chain) == len(stage.chain) + 1
    assert hidden["name"] in {e.name for e in plant.chain}


def test_every_effect_is_drawn_and_none_by_a_clock_that_is_not_known():
    names = {d.draw(seed, SCALE)["name"] for seed in range(200)}
    assert names == set(d.HIDDEN)
    assert {d.draw(seed, SCALE, clock=False)["name"] for seed in range(200)} == names - d.CLOCKED


def test_the_motion_to_diagnose_goes_as_far_and_faster(leuven):
    own, other = leuven.reference("compensate"), d.searching(leuven).reference("compensate")
    assert np.allclose(other.span, own.span, rtol=0.05)
    assert 2.0 < other.peak_speed / own.peak_speed < 4.0
    assert 20.0 <= other.duration <= 30.0
    assert d.searching(leuven, 9.0).reference("compensate").duration == 9.0


def test_limits_keep_the_motion_as_it_is(leuven):
    slow = leuven.changed(limits={"speed": 1.05 * leuven.reference("compensate").peak_speed})
    assert d.searching(slow) is slow


@pytest.mark.slow  # the example of `rtcomp demo` closes it among the quick ones
def test_the_circle_closes(leuven, model):
    """Over one tick of delay, which is no physics that is missing."""
    config = d.searching(leuven.changed(device={"driver": "simulated", "delay_ticks": 1}))
    hidden = {"name": "cogging", "amplitude": 1.2, "period": 1.6e-4, "phase": 0.3}
    ordinary = d.compensated(config, "believed", model)
    plant = d.with_effect(config.stage, hidden)
    circle = d.close_circle(ordinary, config.simulating(plant), hidden, model)
    believed, before, after = circle.errors
    assert before.rms > 5 * believed.rms, "hiding it must hurt, or there is nothing to show"
    assert after.rms < before.rms / 5 and circle.improvement == before.rms / after.rms
    assert "cogging" in circle.named and "drive-delay" not in circle.named
    summary = circle.summary()
    assert summary["hidden"] == hidden and summary["tracking_rms_diagnosed_m"] == after.rms
    rows = {row.name: row for row in circle_rows(circle, "m")}
    assert rows["Hidden"].value == "cogging" and rows["Named by the diagnosis"].note == judged(circle)
    page = render_page(with_circle(Page("title", verdict="first"), circle, "m"))
    assert "was hidden in the stage" in page and "before and after the diagnosis" in page


def test_what_is_believed_is_what_was_identified(leuven, model):
    stage = d.believed(leuven.stage, model)
    levels = [sum(k * r for k, r in s.friction.elements) for s in (stage, leuven.stage)]
    assert levels[0] == pytest.approx(levels[1], rel=0.05)
    assert stage.mass == leuven.stage.mass
