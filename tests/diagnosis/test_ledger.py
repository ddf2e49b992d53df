"""The ledger: friction as units, with what changes it at work, and what is compared of a recording."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from recorded import STAGE, run, stage, there_and_back

from rtcomp.diagnosis.bank import units_along
from rtcomp.diagnosis.base import fit_base
from rtcomp.diagnosis.candidates import effect_of
from rtcomp.diagnosis.ledger import Ledger, believed_weights, grid_of
from rtcomp.diagnosis.motion import (
    UNSEEN,
    WASHED,
    WINDOW_ROWS,
    WINDOWS,
    Strip,
    averaged,
    longest_reach,
    prepare,
)
from rtcomp.diagnosis.refine import consistent, refine
from rtcomp.diagnosis.remembered import Memory
from rtcomp.kernels import Floats
from rtcomp.physics import build
from rtcomp.physics.effect import Place
from rtcomp.recording.reader import Recording
from rtcomp.stage.balance import forces
from rtcomp.stage.stage import Stage


def wander(rows: int = 6000, size: float = 3e-5, seed: int = 2) -> tuple[Floats, Floats]:
    """Time (s) and position (m) of a motion with loops of many sizes."""
    time = np.arange(rows) / 1000.0
    random = np.random.default_rng(seed)
    waves = [
        np.sin(2 * np.pi * f * time + p) / f
        for f, p in zip((0.6, 1.7, 4.1), random.uniform(0, 6, 3), strict=True)
    ]
    return time, size * np.sum(waves, axis=0)


MODIFIERS: list[list[dict[str, Any]]] = [
    [],
    [{"name": "stribeck", "rise": 0.3, "velocity": 1e-4}],
    [{"name": "load-dependent-friction", "coefficient": 0.1}],
    [{"name": "creep", "fraction": 0.3, "time_constant": 0.2}],
    [{"name": "non-congruent-friction", "softening": 0.4}],
    [{"name": "asymmetric-friction", "asymmetry": 0.2}, {"name": "non-congruent-friction", "softening": 0.3}],
    [{"name": "asymmetric-friction", "asymmetry": 0.3, "closing": 1.0}],
    [
        {"name": "asymmetric-friction", "asymmetry": -0.2, "closing": 1.0},
        {"name": "non-congruent-friction", "softening": 0.3},
    ],
    [{"name": "stiction-ageing", "growth": 0.1, "distance": 1e-6}],
    [
        {"name": "frictional-lag", "time_constant": 0.02},
        {"name": "asymmetric-viscous-friction", "ratio": 0.3},
    ],
]


@pytest.mark.parametrize("entries", MODIFIERS, ids=lambda e: "+".join(d["name"] for d in e) or "none")
def test_units_with_their_weights_are_the_stages_friction(entries: list[dict[str, Any]]) -> None:
    """Whatever depends on the whole of friction must see the whole, not the unit."""
    stage = Stage.from_dict(STAGE)
    time, x = wander()
    v = np.gradient(x, time)
    held = np.sin(3.0 * time)
    motion = np.column_stack([time, x, v, np.gradient(v, time), held])
    modifiers = [build(e) for e in entries]
    modifiers += [companion for e in modifiers for companion in e.companions()]
    reaches = np.array([4e-6, 1.2e-5])
    weights = believed_weights(stage, reaches)
    drive = [e for e in stage.chain if e.place is Place.DRIVE]
    table = units_along(stage, drive, modifiers, reaches, weights, motion, 0.0)
    m = stage.mechanics
    ours = table @ np.array([m.viscous, m.micro_damping, *weights])
    chain = [
        *drive,
        *sorted([*modifiers, *(e for e in stage.chain if e.place is Place.FRICTION)], key=lambda e: e.order),
    ]
    whole = -forces(stage, chain, time, x, v, motion[:, 3], held).others()
    assert ours == pytest.approx(whole, abs=1e-9 * float(np.abs(whole).max()))


def recording(time: Floats, x: Floats) -> Recording:
    return Recording({"time": time, "position": x, "voltage": np.sin(time)}, 1000.0)


def test_nothing_is_compared_until_friction_has_forgotten_what_was_before() -> None:
    stage = Stage.from_dict(STAGE)
    time, x = wander()
    motion = prepare(stage, [recording(time, x)])
    (strip,) = motion.strips
    travelled = np.ptp(strip.position[: strip.lead + 1])
    assert WASHED * 1.2e-5 <= travelled <= 1.3 * WASHED * 1.2e-5
    assert motion.kept(strip).start > strip.lead


@pytest.mark.parametrize(("stiffness", "waited_for"), [(1e-13, 1.2e-5), (1e2, 1.2e-5), (1e4, 5e-5)])
def test_no_reach_that_holds_next_to_nothing_is_waited_for(stiffness: float, waited_for: float) -> None:
    """The grid of an identified operator ends in reaches without any force."""
    more = [{"stiffness": 1e-13, "reach": 4.8e-5}, {"stiffness": stiffness, "reach": 5e-5}]
    friction = [*more, *STAGE["stage"]["friction"]]
    assert longest_reach(stage(friction=friction).friction) == waited_for
    assert longest_reach(None) == 0.0


def test_windows_of_a_long_recording_bring_their_lead_along() -> None:
    stage = Stage.from_dict(STAGE)
    time, x = wander(rows=400_000)
    x[:100_000] = 0.0
    motion = prepare(stage, [recording(time, x)])
    assert len(motion.strips) == WINDOWS
    for strip in motion.strips[2:]:
        assert WASHED * 1.2e-5 <= np.ptp(strip.position[: strip.lead + 1]) <= 1.3 * WASHED * 1.2e-5
        rows = (strip.time[-1] - strip.time[strip.lead]) * 1000.0
        assert rows == pytest.approx(WINDOW_ROWS, rel=0.01)


@pytest.mark.parametrize("factor", [2, 3, 5])
def test_averaged_commands_are_held_from_their_row_on(factor: int) -> None:
    """As those of a recording are; else every averaged recording would look late."""
    time = np.arange(600) / 4000.0
    volts = np.random.default_rng(4).standard_normal(600)
    strip = averaged(Strip(time, np.zeros(600), volts, None), factor)
    fine = np.repeat(volts, 100)
    for row in (3, 50, 90):
        begin = round(strip.time[row] * 4000.0 * 100.0)
        assert strip.voltage[row] == pytest.approx(fine[begin : begin + 100 * factor].mean(), abs=1e-9)


@pytest.mark.parametrize(
    "entry",
    [
        {"name": "stribeck", "rise": 0.4, "velocity": 1e-4},
        {"name": "stiction-ageing", "growth": 0.2, "distance": 2e-6, "onset": 0.01},
        {"name": "load-dependent-friction", "coefficient": 0.2},
    ],
    ids=lambda e: str(e["name"]),
)
def test_between_the_ends_stiffness_grows_with_a_part_of_the_level(entry: dict[str, Any]) -> None:
    """Stuck contacts: the force is the plain one at 0, times the level's growth at 1, its root at a half."""
    stage = Stage.from_dict(STAGE)
    time = np.arange(400) / 1000.0
    x = 2e-6 * np.clip(time / 0.05, 0.0, 1.0)  # well inside the shortest reach, then at rest
    v, zero, volts = np.gradient(x, time), np.zeros_like(x), np.ones_like(x)
    drive = [e for e in stage.chain if e.place is Place.DRIVE]
    found = []
    for stiffening in (0.0, 0.5, 1.0):
        chain = [*drive, build({**entry, "stiffening": stiffening}), stage.friction]
        found.append(forces(stage, chain, time, x, v, zero, volts).friction[-1])  # type: ignore[arg-type]
    plain = forces(stage, [stage.friction], time, x, v, zero, volts).friction[-1]  # type: ignore[list-item]
    growth = found[2] / plain
    assert growth > 1.05
    assert found[0] == pytest.approx(plain, rel=1e-9)
    assert found[1] == pytest.approx(plain * np.sqrt(growth), rel=1e-9)


def test_contacts_that_stiffen_multiply_the_whole_force() -> None:
    """With `stiffening` 1 presliding and sliding grow alike, without it only the level does."""
    stage = Stage.from_dict(STAGE)
    time, x = wander()
    v = np.gradient(x, time)
    zero = np.zeros_like(x)
    plain = forces(stage, [stage.friction], time, x, v, zero, zero).friction  # type: ignore[list-item]
    entry = {"name": "position-dependent-friction", "amplitude": 0.3, "period": 2e-5, "phase": 0.4}
    factor = 1.0 + 0.3 * np.sin(2 * np.pi * x / 2e-5 + 0.4)
    found = {}
    for stiffening in (0.0, 1.0):
        effect = build({**entry, "stiffening": stiffening})
        chain = [effect, stage.friction]
        found[stiffening] = forces(stage, chain, time, x, v, zero, zero).friction  # type: ignore[arg-type]
    assert found[1.0] == pytest.approx(factor * plain, rel=1e-12)
    sliding = np.abs(plain) == np.abs(plain).max()
    assert found[0.0][~sliding] != pytest.approx((factor * plain)[~sliding], rel=1e-3)


def test_contacts_that_follow_keep_their_stiffness() -> None:
    """With `following` 1 the force is g h(xi) with d xi = dx / g, for a level that goes as g."""
    stage = Stage.from_dict(STAGE)
    time, x = wander()
    v = np.gradient(x, time)
    zero = np.zeros_like(x)
    entry = {"name": "position-dependent-friction", "amplitude": 0.3, "period": 2e-5, "phase": 0.4}
    level = 1.0 + 0.3 * np.sin(2 * np.pi * x / 2e-5 + 0.4)
    inner = np.cumsum(np.diff(x, prepend=0.0) / level)
    plain = forces(stage, [stage.friction], time, inner, v, zero, zero).friction  # type: ignore[list-item]
    chain = [build({**entry, "following": 1.0}), stage.friction]
    found = forces(stage, chain, time, x, v, zero, zero).friction  # type: ignore[arg-type]
    assert found == pytest.approx(level * plain, rel=1e-9)


def test_a_jump_is_never_put_aside() -> None:
    """It happens once: in a stretch that nothing may look at, it could not be found."""
    time, x = wander()
    motion = prepare(Stage.from_dict(STAGE), [recording(time, x)])
    assert motion.unseen == UNSEEN
    kept, block = motion.plain([s.time for s in motion.strips]), motion.block()
    at = float(kept[block == UNSEEN[1]].mean())
    jumped = replace(motion, jumps=((at, 1e-5),))
    assert set(jumped.unseen) == {UNSEEN[0], UNSEEN[1] + 1, *UNSEEN[2:]}


def test_a_loads_coefficient_is_that_of_the_friction_it_ends_with() -> None:
    """Friction that is believed a fifth too weak: the growth found is the same, the coefficient is not."""
    truth = {"name": "load-dependent-friction", "coefficient": 0.15}
    strong = [{**e, "stiffness": 1.2 * e["stiffness"]} for e in STAGE["stage"]["friction"]]
    axis = Stage.from_dict({**STAGE, "stage": {**STAGE["stage"], "friction": strong, "effects": [truth]}})
    motion = prepare(stage(), [run(axis, there_and_back(12.0))])
    start = {**truth, "coefficient": 0.1}
    base = fit_base(stage(), motion, effects=[effect_of(start)])
    base.ledger.weigh(believed_weights(stage(), base.ledger.reaches))
    found = consistent(refine(base, motion, [start]))
    assert found.entries[0]["coefficient"] == pytest.approx(0.15, rel=0.05)


LUGRE = {
    "model": "lugre", "stiffness": 2.6e5, "damping": 1e3, "coulomb": 1.5, "static": 1.5,
    "stribeck_velocity": 1e-3, "viscous": 0.0,
}  # fmt: skip


@pytest.mark.parametrize("friction", [STAGE["stage"]["friction"], LUGRE], ids=["stop elements", "lugre"])
@pytest.mark.parametrize(
    "entry",
    [
        {"name": "backlash", "gap": 3e-6},
        {"name": "load-dependent-friction", "coefficient": 0.1},
        {"name": "creep", "fraction": 0.2, "time_constant": 0.3},
        {"name": "drive-lag", "time_constant": 2e-3},
        {"name": "sensor-delay", "delay": 2e-3},
    ],
    ids=lambda entry: str(entry["name"]),
)
def test_what_grids_share_is_what_each_would_make_for_itself(entry: dict[str, Any], friction: Any) -> None:
    axis = stage(friction=friction)
    motion = prepare(axis, [run(stage(), there_and_back(4.0))])
    memory = Memory()
    for scale in (0.7, 1.0, 1.4, 1.0):
        alone, sharing = (Ledger(axis, motion, grid_of(axis, scale), [], m) for m in (Memory(), memory))
        for _ in range(2):  # as believed, then with what was found
            one, other = (ledger.system([effect_of(entry)]) for ledger in (alone, sharing))
            assert np.array_equal(one.columns, other.columns) and np.array_equal(one.y, other.y)
            found = one.blocks.power[0] * np.linspace(1.0, 2.0, alone.reaches.size)
            for ledger in (alone, sharing):
                ledger.weigh(found)
                ledger.carried = np.array([1.9, 7.0, 240.0])


def test_a_load_behind_a_play_carries_what_was_found_with_it() -> None:
    """However wrong the belief: the path behind the play is that of a stage that was believed right."""
    motion = prepare(stage(), [run(stage(), there_and_back(4.0))])
    play = effect_of({"name": "backlash", "gap": 2e-6, "share": 0.5, "contact": 250.0})
    right, wrong = stage(), stage(mass=1.8, viscous=9.0, micro_damping=230.0)
    columns = []
    for axis in (right, wrong):
        ledger = Ledger(axis, motion, grid_of(right))
        ledger.weigh(believed_weights(right, ledger.reaches))
        ledger.carried = np.array([2.0, 8.0, 250.0])
        columns.append(ledger.system([play]).columns)
    assert columns[1] == pytest.approx(columns[0], rel=1e-12, abs=1e-15)
