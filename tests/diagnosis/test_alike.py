"""Names that a recording cannot tell apart, and the belief that decides between them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from recorded import run
from recorded import stage as axis
from rtcomp.diagnosis.alike import bounded, last, least_far, plainest, steadily_worse
from rtcomp.diagnosis.base import fit_base
from rtcomp.diagnosis.certain import birge, intervals, neighbours
from rtcomp.diagnosis.departure import USUAL, departure, off
from rtcomp.diagnosis.motion import prepare
from rtcomp.diagnosis.refine import Refined, refine
from rtcomp.diagnosis.scene import Entry

from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.kernels import Floats


def reference() -> Floats:
    time = np.arange(0.0, 12.0, 1e-3)
    waves = [np.sin(2 * np.pi * f * time) / f for f in (0.4, 1.1, 2.3, 5.0)]
    fade = np.clip(np.minimum(time, time[-1] - time) / 0.5, 0.0, 1.0)
    return 4e-4 * fade * np.sum(waves, axis=0)


def test_what_is_believed_rightly_departs_by_nothing() -> None:
    stage = axis()
    fitted = fit_base(stage, prepare(stage, [run(stage, reference())]))
    assert departure(fitted) == 0.0
    assert np.all(np.abs(off(fitted)) < 1.0)


def test_more_than_the_usual_departs_by_the_square_of_what_is_beyond() -> None:
    stage = axis()
    fitted = fit_base(stage, prepare(stage, [run(stage, reference())]))
    light = stage.with_changes(stage={"mass": float(fitted.coefficients[0] / np.exp(3.0 * USUAL))})
    ledger = replace(fitted.ledger, stage=light)
    assert departure(replace(fitted, ledger=ledger)) == pytest.approx(4.0, rel=1e-9)


@pytest.mark.parametrize(
    ("frequency", "mass_leaves", "kept"),
    [
        (0.7, 1.1, ["inertia"]),  # so loose that it stays where it is: that much less mass
        (12.0, 1.1, ["resonance", "inertia"]),  # a second mass that moves
        (0.7, 1.6, ["resonance", "inertia"]),  # as loose, but another mass does not do
    ],
)
def test_a_resonance_that_hangs_loosely_is_another_mass(
    frequency: float, mass_leaves: float, kept: list[str]
) -> None:
    def left(total: float, **entry: object) -> Any:
        return SimpleNamespace(entries=[entry], errors=np.full(20, total / 20.0))

    tried = [
        left(1.0, name="resonance", frequency=frequency, damping=0.7, mass_ratio=0.3),
        left(mass_leaves, name="inertia", mass=1.4),
    ]
    assert [last(r) for r in plainest(tried)] == kept


def test_a_gain_is_estimated_as_well_as_the_belief_allows() -> None:
    """Every column may move by a tenth: the recording alone says nothing more exact of the gain."""
    true, believed = axis(force_constant=4.0 * 0.75), axis()
    motion = prepare(believed, [run(true, reference())])
    base = fit_base(believed, motion)
    refined = refine(base, motion, [{"name": "drive-gain", "gain": 0.85}])
    low, high = intervals(refined, [])[0, "gain"]
    assert low < 0.75 < high
    assert 0.02 < high - low < 0.4


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("drive-gain", {"force_constant": 4.0 * 1.35}),
        ("inertia", {"mass": 2.0 * 1.5}),
        ("inertia", {"mass": 2.0 * 0.85}),
    ],
)
def test_scaled_numbers_are_told_apart_by_what_they_leave_as_believed(
    name: str, changes: dict[str, float]
) -> None:
    found = diagnose(axis(), [run(axis(**changes), reference())])
    if name == "inertia":
        moved = {r.parameter: r.after.value / r.before for r in found.retuned}
        assert moved["mass"] == pytest.approx(changes["mass"] / 2.0, rel=0.05)
        assert not found.effects
    else:
        assert [e.names for e in found.effects] == [(name,)]


@pytest.mark.parametrize(("gain", "preferred"), [(0.95, "inertia"), (0.7, "drive-gain")])
def test_one_number_of_another_value_comes_before_a_little_more_of_everything(
    gain: float, preferred: str
) -> None:
    believed = axis()
    motion = prepare(believed, [run(axis(mass=2.0 * 1.05), reference())])
    base = fit_base(believed, motion)
    scaled = refine(base, motion, [{"name": "drive-gain", "gain": gain}], tries=0)
    heavier = refine(base, motion, [{"name": "inertia", "mass": 2.1}], tries=0)
    as_good = replace(heavier.fitted, errors=0.05 * base.errors)
    tried = [
        replace(scaled, fitted=replace(as_good, errors=0.05 * base.errors)),
        replace(heavier, fitted=replace(as_good, errors=0.051 * base.errors)),
    ]
    assert last(least_far(tried, base)) == preferred


def test_intervals_grow_with_what_is_left_and_with_what_the_grid_decides() -> None:
    true, believed = axis(effects=[{"name": "parallel-spring", "stiffness": 3e3}]), axis()
    motion = prepare(believed, [run(true, reference())])
    base = fit_base(believed, motion)
    refined = refine(base, motion, [{"name": "parallel-spring", "stiffness": 1e3}])

    def width(**more: object) -> float:
        low, high = intervals(refined, **{"beside": [], **more})[0, "stiffness"]  # type: ignore[arg-type]
        assert low < 3e3 < high
        return high - low

    plain = width()
    assert width(worse=3.0) == pytest.approx(3.0 * plain)
    assert width(beside=neighbours(believed, motion, refined)) >= plain
    floor = refined.fitted.errors
    assert birge(refined.fitted, floor) == 1.0 and birge(refined.fitted, 4.0 * floor) == 1.0
    assert birge(refined.fitted, 0.25 * floor) == pytest.approx(2.0)


def test_a_wave_that_does_as_well_comes_before_a_spring_that_pushes_outwards() -> None:
    """Recorded over less than the wave's period; what the spring would do beyond has no end."""
    believed = axis()
    motion = prepare(believed, [run(believed, reference())])
    base = fit_base(believed, motion)

    def leaves(part: float, entry: Entry) -> Refined:
        refined = refine(base, motion, [entry], tries=0)
        return replace(refined, fitted=replace(refined.fitted, errors=part * base.errors))

    outwards = leaves(0.05, {"name": "parallel-spring", "stiffness": -500.0, "cubic": 1e9})
    inwards = leaves(0.05, {"name": "parallel-spring", "stiffness": 500.0, "cubic": 0.0})
    wave: Entry = {"name": "cogging", "amplitude": 0.4, "period": 4e-3, "phase": np.pi}
    near, far = leaves(0.06, wave), leaves(0.09, wave)
    assert bounded(outwards, [outwards, near], base) is near
    assert bounded(outwards, [outwards, far], base) is outwards
    assert bounded(inwards, [inwards, near], base) is inwards


@pytest.mark.parametrize(
    ("ratio", "scatter", "told"),
    [
        (1.4, 0.2, True),  # a little, in every block
        (1.4, 2.0, False),  # as much in all, by accident of some
        (1.05, 0.01, False),  # everywhere, but next to nothing
        (0.7, 0.1, False),
    ],
)
@pytest.mark.parametrize("loud", [1.0, 50.0])
def test_a_name_is_told_apart_by_a_little_that_every_block_has(
    ratio: float, scatter: float, told: bool, loud: float
) -> None:
    best = np.geomspace(1.0, loud, 20)
    either = np.where(np.arange(20) % 2, 1.0, -1.0)[np.random.default_rng(3).permutation(20)]
    assert steadily_worse(best, best * ratio * np.exp(scatter * either)) is told
