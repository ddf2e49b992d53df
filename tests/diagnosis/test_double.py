"""The double of an explanation leaves what the recording leaves; what is beyond that is something else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from recorded import STAGE, run
from test_alike import reference

from rtcomp.diagnosis.accept import is_something_else
from rtcomp.diagnosis.addition import Addition, settle
from rtcomp.diagnosis.base import fit_base
from rtcomp.diagnosis.decide import _not_by_chance
from rtcomp.diagnosis.double import Double
from rtcomp.diagnosis.extend import extended_stage
from rtcomp.diagnosis.floor import floor_errors
from rtcomp.diagnosis.motion import Motion, prepare
from rtcomp.diagnosis.refine import Refined, refine
from rtcomp.diagnosis.scene import Entry
from rtcomp.kernels import Floats
from rtcomp.stage.stage import Stage

SHARP: Entry = {"name": "stribeck", "rise": 0.5, "velocity": 3e-4}
DRIFT: Entry = {"name": "sensor-drift", "drift": 4e-5, "time_constant": 4.0}


def coarse(effects: list[Entry]) -> Stage:
    """A stage whose sensor hardly tells the speeds at which `SHARP` rises."""
    mechanics = {**STAGE["stage"], "effects": effects} if effects else STAGE["stage"]
    return Stage.from_dict({**STAGE, "stage": mechanics, "sensor": {"noise": 6e-8, "resolution": 2e-7}})


def explained(hidden: list[Entry]) -> tuple[Motion, Refined, Floats]:
    """A recording of the stage with `hidden` in it, the fit that has `SHARP`, and the floor of the base."""
    believed = coarse([])
    motion = prepare(believed, [run(coarse(hidden), reference(), seed=7)])
    base = fit_base(believed, motion)
    floor = floor_errors(extended_stage(believed, base, []), base, motion)
    return motion, settle(believed, motion, refine(base, motion, [SHARP])), floor


def test_it_leaves_what_the_recording_leaves_though_kernels_leave_far_more_than_noise() -> None:
    motion, refined, floor = explained([SHARP])
    double = Double.of(coarse([]), refined, motion, floor)
    assert double is not None
    assert double.errors.shape == refined.errors.shape
    assert float(double.errors.sum()) > 2.0 * float(floor.sum())
    assert 0.6 < float(double.errors.sum() / refined.errors.sum()) < 1.6


@pytest.mark.parametrize("hidden", [[SHARP], [SHARP, DRIFT]], ids=["alone", "beside a drift"])
def test_what_is_beyond_its_own_kernel_is_something_else(hidden: list[Entry]) -> None:
    motion, refined, floor = explained(hidden)
    double = Double.of(coarse([]), refined, motion, floor)
    assert double is not None
    beside = settle(coarse([]), motion, refine(refined.fitted, motion, [*refined.entries, DRIFT]))
    chance = double.gain(beside.entries[-1])
    assert chance >= 0.0
    told = is_something_else(refined.errors, beside.errors, double.errors, chance)
    assert told is (DRIFT in hidden)


def test_without_a_controller_there_is_none() -> None:
    motion, refined, floor = explained([SHARP])
    data: dict[str, Any] = {k: v for k, v in STAGE.items() if k != "controller"}
    assert Double.of(Stage.from_dict(data), refined, motion, floor) is None


def test_most_of_what_is_beyond_must_be_explained_and_more_than_by_chance() -> None:
    before, left = np.full(10, 3.0), np.full(10, 1.0)
    assert is_something_else(before, np.full(10, 1.2), left, 0.0)
    assert not is_something_else(before, np.full(10, 2.0), left, 0.0)  # half of what is beyond
    assert not is_something_else(before, np.full(10, 1.2), left, 5.0)
    assert not is_something_else(np.full(10, 1.1), np.full(10, 0.95), left, 0.0)  # little beside what is left


def test_what_gains_as_much_on_the_double_is_not_looked_at() -> None:
    believed = coarse([])
    motion = prepare(
        believed, [run(coarse([{"name": "drive-deadband", "width": 0.03}]), reference(), seed=5)]
    )
    base = fit_base(believed, motion)
    floor = floor_errors(extended_stage(believed, base, []), base, motion)
    plain = refine(base, motion, [])
    found = refine(base, motion, [{"name": "drive-deadband", "width": 0.02}])
    looked = Addition(found, [found], [], {})
    without = Double.of(believed, plain, motion, floor)
    assert _not_by_chance(looked, base, without) == looked
    with_it = Double(motion, plain, 1.0, floor)  # a double in which the drive is dead as well
    assert _not_by_chance(looked, base, with_it) == Addition(None, [], [], {})
    assert _not_by_chance(looked, base, None) is looked
