"""What is said to be the smallest that a recording would have shown, held against recordings that have it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from recorded import RATE, run, stage, there_and_back

from rtcomp.diagnosis.accept import ABOVE_FLOOR
from rtcomp.diagnosis.base import Fitted, fit_base
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.motion import Motion, prepare
from rtcomp.diagnosis.result import Retuned, Sight, Value
from rtcomp.diagnosis.sight import pinned, sight
from rtcomp.kernels import Floats
from rtcomp.physics import catalogue

FLOOR = 0.005
"""Of the force; well above what these recordings leave by themselves."""


def floor_of(fitted: Fitted) -> Floats:
    return np.asarray(FLOOR**2 * fitted.system.blocks.power[fitted.ledger.seen])


def looked_at(reference: Floats) -> tuple[Motion, Fitted]:
    motion = prepare(stage(), [run(stage(), reference)])
    return motion, fit_base(stage(), motion)


@pytest.fixture(scope="module")
def clean() -> tuple[Motion, Fitted]:
    return looked_at(there_and_back(12.0))


@pytest.fixture(scope="module")
def sights(clean: tuple[Motion, Fitted]) -> dict[str, Sight]:
    motion, base = clean
    return {s.name: s for s in sight(motion, base, [], floor_of(base))}


def stands_out(clean: tuple[Motion, Fitted], entry: dict[str, Any]) -> bool:
    """Whether what a recording with that effect leaves of the refitted belief is looked at at all."""
    floor = floor_of(clean[1])
    motion = prepare(stage(), [run(stage(effects=[entry]), there_and_back(12.0))], clean[0].cut)
    return bool(fit_base(stage(), motion).errors.sum() > ABOVE_FLOOR * floor.sum())


@pytest.mark.parametrize("name", [
    "cogging", "drive-deadband", "position-dependent-friction", "parallel-spring", "asymmetric-friction",
    "torque-ripple", "drive-offset", "tonal-disturbance",
])  # fmt: skip
def test_what_is_larger_stands_out_and_what_is_smaller_does_not(
    clean: tuple[Motion, Fitted], sights: dict[str, Sight], name: str
) -> None:
    s = sights[name]
    assert s.seen
    entry = {"name": name, **s.beside}
    assert stands_out(clean, {**entry, s.parameter: 2.5 * s.smallest})
    assert not stands_out(clean, {**entry, s.parameter: 0.3 * s.smallest})


def test_what_scales_everything_or_has_no_room_is_never_seen(sights: dict[str, Sight]) -> None:
    assert not sights["sensor-scale"].seen and math.isinf(sights["sensor-scale"].smallest)


def test_mass_shows_in_fast_motion_and_not_in_slow() -> None:
    t = np.arange(int(12 * RATE)) / RATE
    fade = np.clip(t / 0.5, 0.0, 1.0)
    slow = fade * 2e-4 * np.sin(2 * np.pi * 0.5 * t)
    fast = fade * (2e-4 * np.sin(2 * np.pi * 0.5 * t) + 2e-4 * np.sin(2 * np.pi * 9.0 * t))
    found = []
    for reference in (slow, fast):
        motion, base = looked_at(reference)
        (inertia,) = [s for s in sight(motion, base, [], floor_of(base)) if s.name == "inertia"]
        found.append(inertia)
    assert not found[0].seen
    assert found[1].seen and found[1].smallest < 0.2


def test_a_lower_floor_shows_smaller_ones(clean: tuple[Motion, Fitted], sights: dict[str, Sight]) -> None:
    motion, base = clean
    for s in sight(motion, base, [], 0.25 * floor_of(base)):
        assert s.smallest <= 1.2 * sights[s.name].smallest
        if s.name in ("cogging", "drive-offset", "position-dependent-friction"):
            assert s.smallest == pytest.approx(0.5 * sights[s.name].smallest, rel=0.2)


def test_sizes_are_parameters_of_the_catalogue(sights: dict[str, Sight]) -> None:
    for s in sights.values():
        parameters = {p.name: p for p in catalogue.entry(s.name).parameters}
        assert parameters[s.parameter].unit == s.unit
        assert set(s.beside) <= set(parameters) and s.parameter not in s.beside
        assert s.smallest > 0.0 and s.most > 0.0


def test_every_entry_that_a_motion_could_show_is_asked_for(sights: dict[str, Sight]) -> None:
    models = {"dahl", "gms", "leuven", "lugre", "maxwell-slip", "modified-leuven", "micro-damping"}
    shapes = {"position-force", "sensor-noise", "sensor-resolution", "drive-force"}
    assert {e.name for e in catalogue.entries()} - models - shapes == set(sights)


def test_a_bias_that_the_belief_has_is_a_number_of_the_base_and_seen_all_the_same() -> None:
    belief = stage(effects=[{"name": "drive-offset", "offset": 0.05}])
    motion = prepare(belief, [run(belief, there_and_back(8.0))])
    base = fit_base(belief, motion)
    offset = next(s for s in sight(motion, base, [], floor_of(base)) if s.name == "drive-offset")
    assert offset.seen


def test_what_is_named_already_is_not_asked_for_again() -> None:
    drag: dict[str, object] = {"name": "quadratic-drag", "coefficient": 1e4}
    motion = prepare(stage(), [run(stage(effects=[drag]), there_and_back(8.0))])
    fitted = fit_base(stage(), motion, [effect_of(drag)])
    names = [s.name for s in sight(motion, fitted, [drag], floor_of(fitted))]
    assert "quadratic-drag" not in names and "cogging" in names


def test_a_number_that_moved_less_than_would_show_is_not_reported() -> None:
    def moved(name: str, value: float) -> Retuned:
        return Retuned(name, 2.0, Value(value, 0.99 * value, 1.01 * value, "kg"))

    sights = [
        Sight("inertia", "mass", "kg", 1.0, 2.0, {}),
        Sight("viscous-friction", "coefficient", "", 0.1, 1.0, {}),
    ]
    kept, notes = pinned([moved("mass", 1.7), moved("viscous", 2.3), moved("friction.level", 2.1)], sights)
    assert [r.parameter for r in kept] == ["viscous", "friction.level"]
    (note,) = notes
    assert note.startswith("mass is not pinned")
