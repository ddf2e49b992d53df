"""What a motion leaves open of the model learned from it is said, and only then."""

from __future__ import annotations

import numpy as np
import pytest

from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.hysteresis.stop import StopBasis
from rtcomp.jobs.identify import identify
from rtcomp.jobs.judge import Friction, reached
from rtcomp.jobs.motion_notes import motion_notes, still_rising
from rtcomp.recording.reader import read

TIME = np.arange(4000) / 1000.0
LOOP = 6e-5 * np.sin(2 * np.pi * TIME)
BASIS = IntervalBasis.over(20, 1e-4)


def notes(position):
    model = HysteresisModel(BASIS, np.ones(20), reached=reached(BASIS, position))
    return motion_notes(model, position)


def test_an_ordinary_motion_needs_no_remark():
    assert notes(LOOP) == []
    assert notes(LOOP + 2e-6 * np.random.default_rng(0).standard_normal(4000)) == []
    assert notes(LOOP[::125]) == []  # eight rows a period


@pytest.mark.parametrize(
    ("position", "says"),
    [
        (1e-4 * TIME, "one way only"),
        (-1e-4 * TIME, "one way only"),
        (1e-4 * TIME + 1e-8 * np.random.default_rng(0).standard_normal(4000), "one way only"),
        (1e-4 * TIME + 1e-6 * np.random.default_rng(1).standard_normal(4000), "one way only"),
        (np.round(LOOP / 1e-5) * 1e-5, "20 elements, but only 13 distinct positions"),
        (1e-2 * np.sin(2 * np.pi * TIME), "200 times identify.range"),
        (0.3 * LOOP, "elements 9 to 20 of 20 were never reached"),
        (0.78 * LOOP, "element 20 of 20 was never reached; its weight"),
    ],
)
def test_what_the_motion_lacks_is_said_once(position, says):
    found = notes(position)
    assert len(found) == 1 and says in found[0] and "\n" not in found[0]


def test_an_empty_model_is_said_to_be_empty():
    found = motion_notes(HysteresisModel(BASIS, np.zeros(20), reached=reached(BASIS, LOOP)), LOOP)
    assert len(found) == 1 and found[0].startswith("nothing was learned")


def test_they_reach_the_user(leuven, tmp_path):
    path = tmp_path / "oneway.csv"
    rows = np.column_stack([TIME, 1e-4 * TIME / 4, 0.2 * np.tanh(TIME)])
    np.savetxt(path, rows, delimiter=",", header="time,position,voltage", comments="")
    assert any("one way only" in note for note in identify(leuven, read(path)).notes)


def rising(total, *, speed=0.0, basis=IntervalBasis):
    """Notes on a model of such a range (m) of friction that takes 1e-4 m until everything slides."""
    truth = HysteresisModel(BASIS, np.linspace(1e5, 5e3, 20))
    force = truth.response(LOOP) + speed * np.gradient(LOOP, 1e-3)
    model = HysteresisModel(basis.over(20, total), np.ones(20))
    return still_rising(model, Friction(TIME, LOOP, force, np.ones(4000, dtype=bool)))


@pytest.mark.parametrize("total", [3e-5, 2e-5, 1e-5])
def test_a_range_smaller_than_it_takes_until_everything_slides_is_said(total):
    (found,) = rising(total)
    assert "the force still rises, by" in found and f"make identify.range ({total:.3g}) larger" in found


@pytest.mark.parametrize("total", [1e-4, 9e-5, 1e-3])
def test_a_range_that_is_enough_needs_no_remark(total):
    assert rising(total) == []
    assert rising(total, speed=1e3) == rising(total, speed=-1e3) == []


def test_no_range_is_blamed_where_it_is_not_known_or_another_note_says_it():
    assert rising(2e-5, basis=StopBasis) == []
    assert rising(1e-6) == []


def test_a_range_too_small_reaches_the_user(leuven):
    small = leuven.changed(identify={**leuven.file.data["identify"], "range": 2e-5})
    assert any("the force still rises, by" in note for note in identify(small).notes)
