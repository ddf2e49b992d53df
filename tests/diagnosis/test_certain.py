"""How certain numbers are said to be: by blocks left out, by what entries leave open, by being chosen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recorded import run, there_and_back
from recorded import stage as axis
from scipy.signal import lfilter

from rtcomp.diagnosis.base import fit_base
from rtcomp.diagnosis.certain import (
    Numbers,
    all_by_one_factor,
    covariance,
    elsewhere,
    force_constant,
    intervals,
    may_be_nothing,
    retunings,
    scatter,
    widening,
)
from rtcomp.diagnosis.diagnose import diagnose
from rtcomp.diagnosis.extend import extended_stage
from rtcomp.diagnosis.motion import prepare
from rtcomp.diagnosis.refine import refine


def test_blocks_left_out_tell_how_uncertain_a_mean_is() -> None:
    chance = np.random.default_rng(5)
    found = []
    for _ in range(400):
        blocks = chance.standard_normal((20, 2)) * [1.0, 3.0]
        found.append(scatter((blocks.sum(axis=0) - blocks) / 19.0))
    mean = np.mean(found, axis=0)
    assert np.diag(mean) == pytest.approx([1.0 / 20.0, 9.0 / 20.0], rel=0.15)
    assert abs(mean[0, 1]) < 0.01


def test_blocks_like_their_neighbours_count_as_fewer() -> None:
    chance = np.random.default_rng(6)
    plain, alike = [], []
    for _ in range(200):
        walk = chance.standard_normal((21, 1))
        plain.append(scatter(walk[1:])[0, 0])
        alike.append(scatter((walk[1:] + walk[:-1]) / np.sqrt(2.0))[0, 0])
    assert np.mean(alike) > 1.2 * np.mean(plain)


@pytest.mark.parametrize("alike", [0.0, 0.8])
def test_what_happened_once_is_as_uncertain_as_what_noise_makes_of_it_elsewhere(alike: float) -> None:
    """As wide as least squares scatters over many noises, white or alike for a few rows."""
    chance = np.random.default_rng(7)
    column = np.zeros(4000)
    column[1500:1540] = np.sin(np.arange(40) / 5.0)
    told, found = [], []
    for _ in range(200):
        noise = lfilter([1.0], [1.0, -alike], chance.standard_normal(column.size))
        told.append(elsewhere(column, noise))
        found.append(column @ noise / (column @ column))
    assert np.mean(told) == pytest.approx(np.var(found), rel=0.25)
    if alike == 0.0:
        assert np.mean(told) == pytest.approx(1.0 / (column @ column), rel=0.05)


def test_a_jump_is_as_certain_as_the_moment_tells_it() -> None:
    """One block holds it: leaving that out tells nothing, and was said to leave half of its size open."""
    jump = {"name": "sensor-jump", "time": 4.0125, "size": 2e-5}
    believed = axis()
    motion = prepare(believed, [run(axis(effects=[jump]), there_and_back(8.0))])
    low, high = intervals(refine(fit_base(believed, motion), motion, [dict(jump)]), [])[0, "size"]
    assert low < 2e-5 < high and high - low < 0.08 * 2e-5


def test_numbers_told_because_they_moved_have_wider_intervals() -> None:
    """As Benjamini and Yekutieli have it: all chosen, plain intervals; one of many, much wider ones."""
    assert widening(np.full(5, 9.0), 5) == pytest.approx(1.0, rel=1e-3)
    one, two = widening(np.array([9.0, 0, 0, 0, 0]), 5), widening(np.array([9.0, 9.0, 0, 0, 0]), 5)
    assert 1.1 < two < one < 1.6
    assert widening(np.array([1.1, 0, 0, 0, 0]), 5) == np.inf  # too little to be told


def test_what_scales_all_numbers_leaves_them_as_open_as_itself_is() -> None:
    """A gain that is not there is made up for by mass and friction: none of them is known to have moved."""
    stage = axis()
    motion = prepare(stage, [run(stage, there_and_back(8.0))])
    base = fit_base(stage, motion)
    refined = refine(base, motion, [{"name": "drive-gain", "gain": 0.9}], tries=1)
    level = stage.friction.level  # type: ignore[union-attr]
    told = retunings(Numbers.of(stage, refined, [], extended_stage(stage, refined.fitted, [])), "linear")
    assert all(r.after.low <= level <= r.after.high for r in told if r.parameter == "friction.level")
    assert float(np.sqrt(covariance(refined)[0, 0])) * refined.knobs[0].step > 0.01


def test_a_number_in_two_parts_is_as_certain_as_where_the_belief_holds_one_of_them() -> None:
    """How viscous friction is shared between the base and the entry beside it is no matter of the sum."""
    believed = axis()
    motion = prepare(believed, [run(axis(viscous=16.0), there_and_back(8.0))])
    refined = refine(fit_base(believed, motion), motion, [{"name": "viscous-friction", "coefficient": 7.0}])
    bounds = refined.fitted.bounds
    low, high = bounds.low.copy(), bounds.high.copy()
    low[1], high[1] = 0.0, 20.0
    shared = replace(refined, fitted=replace(refined.fitted, bounds=replace(bounds, low=low, high=high)))
    assert bounds.low[1] < bounds.high[1] < 9.0
    assert covariance(shared)[0, 0] == pytest.approx(covariance(refined)[0, 0], rel=0.3)


def test_a_mass_that_is_another_is_told_with_an_interval_that_holds_it() -> None:
    true, believed = axis(mass=2.0 * 1.09), axis()
    motion = prepare(believed, [run(true, there_and_back(8.0))])
    refined = refine(fit_base(believed, motion), motion, [])
    found = believed.with_changes(stage={"mass": float(refined.fitted.coefficients[0])})
    numbers = Numbers.of(believed, refined, [], found)
    assert all_by_one_factor(numbers) is None
    told = {r.parameter: r.after for r in retunings(numbers, "linear")}
    assert list(told) == ["mass"]
    assert told["mass"].low <= true.mass <= told["mass"].high


def numbers(*found: float, half: float = 0.01, held: float = 0.0) -> Numbers:
    """Mass, viscous friction, micro-damping and level, of which 1 was believed; the reach as believed."""
    return Numbers(
        np.ones(5), np.array([*found, 1.0]), np.full(5, half), np.array([held, held, 0.0, 0.0, 0.0])
    )


@pytest.mark.parametrize(
    ("told", "factor"),
    [
        (numbers(1.1, 1.1, 1.1, 1.1), 1.1),
        (numbers(0.93, 0.94, 0.93, 0.935), 0.934),
        (numbers(1.1, 1.1, 1.1, 1.0), None),  # friction's level is as believed
        (numbers(1.1, 1.04, 1.1, 1.1), None),
        (numbers(1.12, 1.12, 1.2, 1.2, half=0.02, held=0.12), 1.198),  # bounds of the belief say nothing
        (numbers(1.1, 1.1, 1.0, 1.1, half=0.2), None),  # nothing is known
        (numbers(1.01, 1.01, 1.01, 1.01, half=0.001), None),  # a hundredth is no news
    ],
)
def test_forces_that_all_moved_by_one_factor_are_another_force_constant(
    told: Numbers, factor: float | None
) -> None:
    found = all_by_one_factor(told)
    if factor is None:
        assert found is None
        return
    assert found is not None and found[0] == pytest.approx(factor, abs=0.003)
    one = force_constant(axis(), *found)
    assert one.after.value == pytest.approx(one.before / factor, rel=0.003)
    assert one.after.low < one.after.value < one.after.high


@pytest.mark.parametrize(("mass", "held"), [(0.892, False), (0.80, True)])
def test_a_number_just_within_what_may_be_believed_is_told_by_the_recording(mass: float, held: bool) -> None:
    believed = axis()
    true = axis(mass=mass * believed.mass)
    motion = prepare(believed, [run(true, there_and_back(8.0))])
    refined = refine(fit_base(believed, motion), motion, [])
    found = Numbers.of(believed, refined, [], extended_stage(believed, refined.fitted, []))
    assert bool(found.held[0]) is held
    told = {r.parameter: r.after for r in retunings(found, "linear")}
    assert held or told["mass"].low <= true.mass <= told["mass"].high


def test_a_number_that_is_not_believed_says_nothing_of_the_others() -> None:
    some = numbers(1.1, 0.0, 0.0, 1.1)
    zero = np.array([1.0, 0.0, 0.0, 1.0, 1.0])
    assert all_by_one_factor(replace(some, before=zero)) is None  # two are too few
    three = replace(numbers(1.1, 1.1, 0.0, 1.1), before=np.array([1.0, 1.0, 0.0, 1.0, 1.0]))
    assert all_by_one_factor(three) is not None


def test_a_force_constant_that_is_another_is_told_as_such_and_moves_alike() -> None:
    true, believed = axis(force_constant=4.0 / 1.08), axis()
    motion = run(true, there_and_back(8.0))
    done = diagnose(believed, [motion])
    assert done.verdict == "retuned"
    (told,) = done.retuned
    assert told.parameter == "force_constant"
    assert told.after.low <= true.force_constant <= told.after.high
    assert done.stage.force_constant == pytest.approx(true.force_constant, rel=0.02)
    assert done.stage.mass == pytest.approx(believed.mass, rel=0.03)
    assert done.fit.after < 0.2 * done.fit.before


SPRING = {"name": "parallel-spring", "stiffness": 1.0, "cubic": 0.0}
BENT = {"name": "parallel-spring", "stiffness": 0.0, "cubic": 4e10}
AGEING = {"name": "stiction-ageing", "growth": 0.01, "distance": 1e-6, "onset": 0.05}
STRIBECK = {"name": "stribeck", "rise": 0.3, "velocity": 2e-4}


@pytest.mark.parametrize(
    ("hidden", "tried", "nothing"),
    [
        ([], SPRING, True),
        ([], AGEING, True),
        ([SPRING | {"stiffness": 800.0}], SPRING, False),
        ([BENT], SPRING | {"cubic": 1e9}, False),
        ([STRIBECK], STRIBECK | {"rise": 0.1}, False),
    ],
)
def test_what_is_not_there_may_be_nothing_by_its_own_interval(
    hidden: list[dict[str, object]], tried: dict[str, object], nothing: bool
) -> None:
    believed = axis()
    motion = prepare(believed, [run(axis(effects=hidden), there_and_back(8.0))])
    refined = refine(fit_base(believed, motion), motion, [dict(tried)])
    assert may_be_nothing(refined) is nothing
