"""An axis that sticks finer than its encoder sees is judged by where short simulations end."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rtcomp.diagnosis.by_position.decide import Judge, Judged, Step, Verdicts, drop, worth_it
from rtcomp.diagnosis.by_position.told import holds, unsure
from rtcomp.diagnosis.by_position.turning import Setting, fit
from rtcomp.diagnosis.by_position.windows import windows_of
from rtcomp.diagnosis.motion import BLOCKS

from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.result import PositionFit
from rtcomp.diagnosis.sticking import MUCH, hidden, mostly_hidden
from rtcomp.jobs.demo import shipped
from rtcomp.recording.driven import driven
from rtcomp.recording.reader import Recording, read
from rtcomp.stage.simulate import Simulator
from rtcomp.stage.stage import Stage

RATE = 200.0
COUNT = 1.5e-3
CUT = 8.0
BELIEF: dict[str, Any] = {
    "stage": {
        "axis": "rotary",
        "mass": 7.0e-3,
        "force_constant": 8.0e-4,
        "voltage_limit": 885.0,
        "viscous": 0.03,
        "friction": [{"stiffness": 40.0, "reach": 1.0e-3}],
        "effects": [{"name": "gravity", "amplitude": -0.48}],
    },
    "sensor": {"resolution": COUNT},
    "rate": RATE,
}


def stage(*effects: dict[str, Any], **changes: Any) -> Stage:
    """The pendulum with further effects and other values."""
    section = {**BELIEF["stage"], **changes}
    return Stage.from_dict({**BELIEF, "stage": {**section, "effects": [*section["effects"], *effects]}})


def recorded(axis: Stage, seconds: float = 8.0, gain: float = 500.0, pace: float = 1.0) -> Recording:
    """The pendulum under a proportional controller that a slow and a fast wave lead."""
    time = np.arange(round(seconds * RATE)) / RATE
    reference = 1.5 * np.sin(pace * time) + 0.5 * np.sin(4.3 * pace * time) * np.sin(2.0 * pace * time)
    simulator = Simulator(axis)
    position, voltage = np.empty_like(time), np.empty_like(time)
    for k in range(time.size):
        position[k] = simulator.measure()
        voltage[k] = np.clip(gain * (reference[k] - position[k]), -885.0, 885.0)
        simulator.advance(float(voltage[k]), 1.0 / RATE)
    columns = {"time": time, "reference": reference, "position": position, "voltage": voltage}
    return Recording(columns, RATE)


LOAD = {"name": "load-dependent-friction", "coefficient": 0.25, "external": 0.25}


@pytest.fixture(scope="module")
def loaded() -> list[Recording]:
    """Recordings of a pendulum whose friction grows with its load."""
    plant = stage(LOAD)
    return [recorded(plant), recorded(plant, gain=300.0, pace=1.4)]


def test_sticking_finer_than_a_count_is_told_from_rest_and_from_motion() -> None:
    axis = stage()
    rows = np.arange(600)
    position = np.where(rows < 300, 0.2, 0.2 + (rows - 300) * 5e-3) + COUNT * 0.4 * (rows % 2)
    changing = 200.0 + 100.0 * np.sin(rows / 20.0)
    found = hidden(axis, position, changing, COUNT)
    assert found[:300].all() and not found[305:].any()
    assert not hidden(axis, position, np.full(600, 200.0), COUNT).any()
    assert not hidden(axis, position, changing, 0.0).any()


def test_presliding_that_the_sensor_resolves_is_not_hidden() -> None:
    plant = stage(friction=[{"stiffness": 1.0, "reach": 0.04}])
    sees = Stage.from_dict({**plant.to_dict(), "sensor": {"resolution": 1e-6}})
    assert (
        mostly_hidden(sees, [recorded(sees)]) < 0.02 < MUCH < mostly_hidden(stage(), [recorded(stage(LOAD))])
    )


def test_no_window_lies_in_two_blocks_and_every_block_has_its_part(loaded: list[Recording]) -> None:
    windows = windows_of(loaded, CUT)
    assert sorted(set(windows.block)) == list(range(BLOCKS))
    before, at = 0, 0
    for track, starts in zip(windows.tracks, windows.starts, strict=True):
        for start in starts:
            rows = before + np.arange(start, start + windows.rows)
            assert set(rows // windows.stretch % BLOCKS) == {windows.block[at]}
            at += 1
        before += track.time.size
    unseen = np.concatenate(windows.unseen_rows())
    assert 0.1 < unseen.mean() < 0.25


def test_the_right_stage_is_off_by_what_the_sensor_leaves(loaded: list[Recording]) -> None:
    windows = windows_of(loaded, CUT)
    right, believed = stage(LOAD), stage()
    floor = np.abs(windows.as_if(right, CUT, 1).off(right)).mean()
    assert np.abs(windows.off(right)).mean() < 3.0 * floor
    assert np.abs(windows.off(believed)).mean() > 6.0 * floor


def test_mistuned_numbers_come_back() -> None:
    data = [recorded(stage()), recorded(stage(), gain=300.0, pace=1.4)]
    windows = windows_of(data, CUT)
    mistuned = stage(mass=7.6e-3, force_constant=7.2e-4, viscous=0.035)
    found = fit(Setting(mistuned, {}, ()), windows, 0.02, windows.seen)[0].stage()
    assert found.mass == pytest.approx(7.0e-3, rel=0.05)
    assert found.force_constant == pytest.approx(8.0e-4, rel=0.05)


def test_the_scale_of_all_forces_stays_as_believed_where_nothing_measures_it() -> None:
    names = {k.name for k in Setting(stage(), {}, ()).knobs()}
    free = Stage.from_dict({**BELIEF, "stage": {**BELIEF["stage"], "effects": []}})
    assert "force_constant" in names
    assert "force_constant" not in {k.name for k in Setting(free, {}, ()).knobs()}


def test_what_helps_in_one_block_only_is_an_accident() -> None:
    before = np.ones(10)
    once, always = before.copy(), before * 0.7
    once[3] = 0.0
    assert worth_it(before, always) and not worth_it(before, once)


@pytest.mark.parametrize(
    ("halves", "at"),
    [
        ({}, None),
        ({(1, "rise"): 0.9}, None),
        ({(1, "rise"): 1.1}, 1),  # from less than nothing to twice as much
        ({(0, "coefficient"): 3.0, (0, "external"): 3.0}, None),  # by a factor: never nothing
        ({(1, "velocity"): 3.0}, None),  # how it looks is not known; that it is there is
        ({(1, "rise"): 1.1, (2, "amplitude"): 2.0}, 2),  # the last found goes first
    ],
)
def test_an_entry_whose_size_is_not_told_from_none_goes(
    halves: dict[tuple[int, str], float], at: int | None
) -> None:
    entries = (
        LOAD,
        {"name": "stribeck", "rise": 0.5, "velocity": 0.3},
        {"name": "cogging", "amplitude": 0.02, "period": 1.1, "phase": 0.3},
    )
    judged = Judged(Setting(stage(), {}, entries), 1.0, np.ones(BLOCKS))
    assert unsure(Verdicts(judged, judged), halves) == at


@pytest.mark.parametrize(
    ("after", "good"),
    [
        (1.2, True),
        (2.33, False),  # a hundredth closer than retuned, far from what noise leaves: chance
        (2.37, False),
        (0.14, True),  # as near as noise leaves it
    ],
)
def test_names_must_end_closer_on_windows_that_were_not_seen(after: float, good: bool) -> None:
    assert holds(PositionFit(5.3e-6, 2.36e-6, after * 1e-6, 0.1e-6, 0.04)) is good


def test_near_the_noise_names_need_only_do_no_harm() -> None:
    assert holds(PositionFit(0.14e-6, 0.12e-6, 0.119e-6, 0.1e-6, 0.04))
    assert not holds(PositionFit(0.14e-6, 0.12e-6, 0.125e-6, 0.1e-6, 0.04))


def test_the_last_entry_that_goes_leaves_the_refitted_belief(loaded: list[Recording]) -> None:
    windows = windows_of(loaded, CUT)
    base = Judged(Setting(stage(), {}, ()), 2.0, np.full(BLOCKS, 0.2))
    best = Judged(Setting(stage(), {}, (LOAD,)), 1.0, np.full(BLOCKS, 0.1))
    found = Verdicts(base, best, [Step(["load-dependent-friction"], 1.0, 1.0)])
    drop(Judge(windows, 0.02), found, 0)
    assert found.best is base and not found.steps


@pytest.mark.slow
def test_friction_that_grows_with_the_load_is_named_and_nothing_else(loaded: list[Recording]) -> None:
    done = diagnose(stage(), loaded)
    assert done.verdict == "missing-physics"
    assert done.effects[0].names[0] == "load-dependent-friction"
    assert done.effects[0].share > 0.8
    assert done.position is not None and done.position.after < 0.4 * done.position.retuned
    found = done.effects[0].parameters["coefficient"]
    assert found.value == pytest.approx(0.25, abs=0.12)
    assert done.to_json()["fit"]["position_error"]["after"] == done.position.after


@pytest.mark.slow
def test_a_pendulum_as_believed_is_left_in_peace() -> None:
    plant = stage()
    done = diagnose(plant, [recorded(plant), recorded(plant, gain=300.0, pace=1.4)])
    assert done.position is not None
    assert done.verdict in ("consistent", "retuned") and not done.effects


@pytest.mark.slow
@pytest.mark.parametrize(("learned", "judged"), [((200, 400), 100), ((100, 400), 200)])
def test_a_measured_servo_is_predicted_at_a_gain_that_was_not_looked_at(
    learned: tuple[int, int], judged: int
) -> None:
    """At 100 and 400 noise leaves little of the force open, and still forces say nothing."""
    folder = Path(os.environ.get("RTCOMP_SHARED", Path(__file__).parents[3] / "shared/data"))
    folder = folder / "real/servo-pendulum"
    if not folder.is_dir():
        pytest.skip(f"needs the recordings of a servo with a pendulum at {folder}")
    columns = {"voltage": "duty", "enabled": "torque_enabled"}

    def gain(number: int) -> list[Recording]:
        files = sorted(folder.glob(f"kp{number}_*.csv"))
        return [part for path in files for part in driven(read(path, columns, rate_hz=RATE))]

    done = diagnose(
        Stage.load(shipped("xl330_pendulum.yaml")), [part for number in learned for part in gain(number)]
    )
    assert done.effects[0].names[0] == "load-dependent-friction"
    windows = windows_of(gain(judged), CUT)
    assert done.retuned_stage is not None
    retuned, extended = (np.abs(windows.off(s)).mean() for s in (done.retuned_stage, done.stage))
    assert extended < retuned / 1.5
    assert "stribeck" not in {name for e in done.effects for name in e.names}  # nearly none, or thrice
