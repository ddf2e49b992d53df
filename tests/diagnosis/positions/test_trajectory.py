"""An axis that sticks finer than its encoder sees is judged by where short simulations end."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pendulum import COUNT, LOAD, RATE, balanced, both, recorded, stage
from recorded import at_hand

from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.fitting.intervals import numbers
from rtcomp.diagnosis.fitting.other_forms import in_any_form
from rtcomp.diagnosis.forces.replicate import replicate
from rtcomp.diagnosis.forces.sticking import courses, untold
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.positions.belief import Belief
from rtcomp.diagnosis.positions.hidden import MUCH, hides
from rtcomp.diagnosis.positions.trajectory import Trajectory
from rtcomp.diagnosis.positions.windows import GROUPS, Windows
from rtcomp.errors import ConfigError
from rtcomp.jobs.demo import shipped
from rtcomp.recording.driven import driven
from rtcomp.recording.reader import Recording, read
from rtcomp.stage.stage import Stage

STIFF = [{"stiffness": 80.0, "reach": 1.0e-3}]
FINE = [{"stiffness": 1.1, "reach": 0.01}, {"stiffness": 0.4, "reach": 0.06}]


@pytest.fixture(scope="module")
def loaded() -> list[Recording]:
    """Recordings of a pendulum whose friction grows with its load."""
    return both(stage(LOAD))


def test_force_that_a_count_hides_is_told_from_rest_and_from_motion() -> None:
    axis = stage()
    rows = np.arange(600)
    position = np.where(rows < 300, 0.2, 0.2 + (rows - 300) * 5e-3) + COUNT * 0.4 * (rows % 2)
    force = axis.force_constant * (20.0 + 10.0 * np.sin(rows / 20.0))
    course, stretch = courses(position, force, 1.5 * COUNT, np.inf)
    assert np.all(stretch[:300] == 0) and np.all(np.diff(stretch) >= 0)
    assert course[:300] == pytest.approx(force[:300] - force[:300].mean(), abs=0.1 * np.ptp(force))
    assert np.abs(course[305:]).max() < 0.05 * np.abs(course[:300]).max()
    assert not courses(position, np.ones(600), 1.5 * COUNT, np.inf)[0].any()


@given(st.floats(0.0, 2.0), st.floats(0.0, 1e-2))
def test_friction_does_unseen_no_more_than_it_can(most: float, width: float) -> None:
    rows = np.arange(300)
    force, position = np.sin(rows / 9.0), 0.02 * np.sin(rows / 30.0)
    course, _ = courses(position, force, width, most)
    assert np.abs(course).max() <= most
    assert width > 0.0 or not course.any()


def test_rows_of_rest_count_less_and_those_of_motion_whole() -> None:
    """The command goes on while the reading does not."""
    plant = stage(friction=STIFF)
    run = recorded(plant)
    rests = np.arange(run.position.size) % 600 < 200
    held = np.where(rests, run.position[np.arange(rests.size) // 600 * 600], run.position)
    balance = balanced(plant, [replace(run, columns={**run.columns, "position": held})])
    at_rest = balance.plain([rests.astype(np.float64)]) > 0.0
    assert np.all((balance.trust > 0.0) & (balance.trust <= 1.0))
    speed = np.abs(balance.plain([p.v for p in balance.paths()]))
    fast = ~at_rest & (speed > np.median(speed[~at_rest]))
    assert np.median(balance.trust[at_rest]) < 0.5 < 0.8 < np.median(balance.trust[fast])
    exact = Stage.from_dict({**plant.to_dict(), "sensor": {}})
    assert np.all(balanced(exact, [recorded(exact)]).trust == 1.0)


def test_friction_has_the_more_to_hide_in_the_coarser_the_sensor() -> None:
    parts = []
    for count in (3e-2, COUNT, 1e-6):
        axis = Stage.from_dict({**stage(friction=STIFF).to_dict(), "sensor": {"resolution": count}})
        balance = balanced(axis, both(axis))
        parts.append(untold(balance))
    assert parts[0] > parts[1] > MUCH > parts[2]
    assert not hides(Fitter(balance), Fitter(balance).fit([]))


def test_a_balance_that_does_not_know_its_own_replicate_again_is_no_judge() -> None:
    """Friction that yields within a count, and as much of it that yields over some of them."""
    wide = [{"stiffness": 0.01 / (k * COUNT), "reach": k * COUNT} for k in range(1, 9)]
    found = []
    for friction in (STIFF, wide):
        axis = stage(friction=friction)
        balance = balanced(axis, both(axis))
        assert untold(balance) > MUCH
        found.append(hides(Fitter(balance), Fitter(balance).fit([])))
    assert found == [True, False]


def test_friction_that_is_little_beside_a_spring_hides_nothing() -> None:
    spring = {"name": "parallel-spring", "stiffness": 2.0}
    sprung = stage(spring, friction=[{"stiffness": 1.0, "reach": 1.0e-3}])
    assert untold(balanced(sprung, [recorded(sprung)])) < 0.1 * MUCH


def test_a_constant_force_that_was_found_with_the_friction_has_its_own_unit(loaded: list[Recording]) -> None:
    """A belief without friction is judged as forces have it: what they found beside it is believed then."""
    believed = stage()
    found = stage({"name": "constant-force", "force": 0.02})
    fitter = Trajectory.of(balanced(believed, loaded), found)
    told = numbers(fitter, found, fitter.fit([], steps=0), effects=True)
    assert len(told.units) == told.values.size == told.before.size
    assert told.units[-1] == "N"


def test_a_way_run_at_a_steady_speed_is_no_work_of_forces(loaded: list[Recording]) -> None:
    balance = balanced(stage(), loaded)
    windows = Windows.of(balance)
    own = windows.forced()
    gone = tuple(replace(s, position=s.position + 3.0 * s.time) for s in balance.data.segments)
    faster = windows.on(balance.on(replace(balance.data, segments=gone)))
    assert np.std(faster.moved() - windows.moved()) > 0.2 * np.std(own)
    assert faster.forced() == pytest.approx(own, abs=0.03 * float(np.std(own)))


@pytest.mark.parametrize(
    "entry", [{"name": "sensor-scale", "scale": 0.0}, {"name": "drive-delay", "delay": -1.0}]
)
def test_an_effect_beyond_its_bounds_is_told_as_such(entry: dict[str, Any]) -> None:
    belief = Belief(stage(), 1.0)
    still = np.zeros(len(belief.numbers))
    assert belief.moved(still, []).mass == pytest.approx(stage().mass)
    with pytest.raises(ConfigError, match=entry["name"]):
        belief.moved(still, [entry])


def test_no_block_is_without_windows() -> None:
    """Short recordings, in which a window is more than half as long as a block."""
    for seconds in (8.0, 10.0, 14.0):
        balance = balanced(stage(), [recorded(stage(), seconds)])
        windows = Windows.of(balance)
        rows = np.concatenate(
            [np.arange(s.time.size)[balance.whitening.rows(s)] for s in balance.data.segments]
        )
        own = balance.block[np.searchsorted(rows, windows.starts[0])]
        assert set(own) == set(range(balance.blocks)) and windows.reserved.any()


def test_windows_lie_apart_and_those_of_reserved_blocks_are_a_group_of_their_own(
    loaded: list[Recording],
) -> None:
    balance = balanced(stage(), loaded)
    windows = Windows.of(balance)
    assert all(np.all(np.diff(starts) >= windows.rows) for starts in windows.starts)
    assert set(windows.block) == set(range(GROUPS + 1))
    assert np.count_nonzero(windows.block == GROUPS) == np.count_nonzero(windows.reserved)
    before, at = 0, 0
    for segment, starts in zip(balance.data.segments, windows.starts, strict=True):
        kept = balance.whitening.rows(segment)
        for start in starts:
            number = before + (start + np.arange(windows.rows) - kept.start) // kept.step
            inside = number[number < before + segment.time[kept].size]
            assert len(set(balance.block[inside])) == 1
            assert balance.reserved[balance.block[inside[0]]] == windows.reserved[at]
            at += 1
        before += segment.time[kept].size


def test_the_right_stage_is_off_by_what_the_sensor_leaves(loaded: list[Recording]) -> None:
    right, believed = stage(LOAD), stage()
    balance = balanced(believed, loaded)
    windows = Windows.of(balance)
    motion = [p.x for p in balance.paths()]
    data = replicate(right, balance.data, motion, balance.noise.rms, 1)
    assert data is not None
    floor = np.abs(windows.on(balance.on(data)).off(right)).mean()
    assert np.abs(windows.off(right)).mean() < 3.0 * floor
    assert np.abs(windows.off(believed)).mean() > 6.0 * floor


def test_numbers_that_are_off_come_back() -> None:
    data = both(stage())
    # All forces by one factor more: the force constant is what everything is measured by.
    off = stage(mass=7.7e-3, viscous=0.036, friction=[{"stiffness": 55.0, "reach": 1.0e-3}])
    fitter = Trajectory.of(balanced(off, data), off)
    model = fitter.fit([])
    found = fitter.stage(model)
    assert found.mass == pytest.approx(7.0e-3, rel=0.03)
    assert found.friction.level == pytest.approx(0.04, rel=0.05)  # type: ignore[union-attr]
    assert fitter.relative(model) < 0.2 * np.sqrt(np.mean(fitter.left_by(off)[fitter.rows] ** 2))


def test_damping_below_a_speed_comes_back_where_the_belief_has_another_speed() -> None:
    true = stage(micro_damping=0.3, micro_damping_speed=0.3)
    data = both(true)
    off = stage(micro_damping=0.3, micro_damping_speed=0.4)
    fitter = Trajectory.of(balanced(off, data), off)
    mechanics = fitter.stage(fitter.fit([])).mechanics
    assert mechanics.micro_damping_speed == pytest.approx(0.3, rel=0.1)


def test_a_spring_that_begins_with_the_wrong_law_finds_its_own() -> None:
    spring = {"name": "parallel-spring", "stiffness": 0.2}
    plant, level = (
        stage().with_changes(stage={"effects": [spring]}),
        stage().with_changes(stage={"effects": []}),
    )
    fitter = Trajectory.of(balanced(level, both(plant)), level)
    model = fitter.fit([Term.of({**spring, "stiffness": 0.0, "cubic": 0.05})], fitter.fit([]))
    assert model.entries[0]["stiffness"] == pytest.approx(0.2, rel=0.1)


def test_friction_of_another_shape_than_believed_is_not_what_is_missing() -> None:
    """Its elements are off one by one, as those of a belief are; a spring is no such thing."""
    true = [{"stiffness": 1.3, "reach": 0.01}, {"stiffness": 0.3, "reach": 0.06}]
    believed = stage(friction=FINE)
    left = {}
    for name, plant in (
        ("shape", stage(friction=true)),
        ("spring", stage({"name": "parallel-spring", "stiffness": 0.1}, friction=FINE)),
    ):
        fitter = Trajectory.of(balanced(believed, both(plant)), believed)
        model = fitter.fit([])
        other = in_any_form(fitter, model, fitter.other_friction(model))
        left[name] = fitter.relative(other) / fitter.relative(model)
    assert left["shape"] < 0.7 and left["spring"] > 0.9


def test_overtones_of_a_wave_are_the_same_wave() -> None:
    wave = {"name": "cogging", "amplitude": 0.1, "period": 0.6, "phase": 0.4}
    plant = stage({**wave, "harmonics": [{"order": 2.0, "amplitude": 0.02, "phase": 1.0}]})
    fitter = Trajectory.of(balanced(stage(), both(plant)), stage())
    model = fitter.fit([Term.of(wave)], fitter.fit([]))
    in_any = in_any_form(fitter, model, fitter.variants(model, 0))
    assert fitter.relative(in_any) < 0.8 * fitter.relative(model)


@pytest.mark.slow
def test_a_band_without_force_that_friction_takes_up_is_named() -> None:
    done = diagnose(stage(), both(stage({"name": "drive-deadband", "width": 40.0})), budget=200.0)
    assert done.verdict == "missing-physics"
    assert [effect.names[0] for effect in done.effects] == ["drive-deadband"]
    assert done.effects[0].parameters["width"].value == pytest.approx(40.0, rel=0.15)


def test_what_a_model_lacks_is_what_its_slopes_say() -> None:
    """The fit's own linearisation predicts what a small change of a number does."""
    data = both(stage())
    fitter = Trajectory.of(balanced(stage(), data), stage())
    drag = Term({"name": "quadratic-drag", "coefficient": 2e-3}, frozenset({"coefficient"}))
    model = fitter.fit([drag], steps=0)
    (free,) = model.free
    moved = list(model.terms)
    free.put(moved, free.get(moved) + 2.0 * free.step)
    change = fitter.residual(model.coefficients, moved) - model.residual
    predicted = -2.0 * free.step * model.tangents[0]
    assert np.linalg.norm(change - predicted) < 0.15 * np.linalg.norm(change)


@pytest.mark.slow
def test_friction_that_grows_with_the_load_is_named(loaded: list[Recording]) -> None:
    done = diagnose(stage(), loaded, budget=200.0)
    assert done.verdict == "missing-physics"
    assert "load-dependent-friction" in done.effects[0].names
    if done.position is None:  # forces tell it: nothing but noise is left of them
        assert done.fit.after < 1.1 * done.fit.floor < done.fit.retuned
    else:
        assert done.position.after < 0.4 * done.position.retuned
        assert done.to_json()["fit"]["position_error"]["after"] == done.position.after


@pytest.mark.slow
def test_a_pendulum_as_believed_is_left_in_peace() -> None:
    plant = stage(friction=STIFF)
    done = diagnose(plant, both(plant), budget=300.0)
    assert done.position is not None
    assert done.verdict in ("consistent", "retuned") and not done.effects


@pytest.mark.slow
def test_a_measured_servo_is_not_given_a_wrong_name() -> None:
    """Its authors know it to have friction by load, and more: that is named, or nothing."""
    folder = at_hand("real/servo-pendulum")
    columns = {"voltage": "duty", "enabled": "torque_enabled"}

    def gain(number: int) -> list[Recording]:
        files = sorted(folder.glob(f"kp{number}_*.csv"))
        return [part for path in files for part in driven(read(path, columns, rate_hz=RATE))]

    believed = Stage.load(shipped("xl330_pendulum.yaml"))
    done = diagnose(believed, [*gain(200), *gain(400)], budget=300.0)
    assert done.verdict in ("missing-physics", "unexplained") and done.position is not None
    for effect in done.effects:
        assert {"load-dependent-friction", "unexplained"} & set(effect.names), effect.names
