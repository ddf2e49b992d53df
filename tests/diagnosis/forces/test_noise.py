"""The noise of the readings: as stated, within what the recording has, and never less than it plainly has."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.forces.noise import Noise
from rtcomp.diagnosis.forces.replicate import replicate
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.diagnosis.recordings.data import load_data


@pytest.mark.parametrize("times", [1.0, 2.0, 10.0])
def test_noise_is_what_the_recording_has_where_the_stage_states_less(times: float) -> None:
    belief = stage()
    stated = Noise.stated(belief)
    axis = belief.with_changes(sensor={"noise": times * stated, "resolution": 0.0})
    data = load_data([run(axis, there_and_back(20.0))])
    assert Noise.of(belief, data).rms == pytest.approx(times * stated, rel=0.1)


def test_a_replicate_is_as_noisy_as_its_recording() -> None:
    belief = stage()
    axis = belief.with_changes(sensor={"noise": 8e-8})
    data = load_data([run(axis, there_and_back(4.0))])
    (segment,) = data.segments
    made = replicate(belief, data, [segment.position], Noise.of(belief, data).rms, seed=3)
    assert made is not None
    jitter = [np.std(np.diff(one.segments[0].position, 3)) for one in (made, data)]
    assert jitter[0] == pytest.approx(jitter[1], rel=0.1)


SAID = "times as noisy as the stage states"


def test_a_sensor_that_is_noisier_than_stated_is_no_missing_physics_and_said() -> None:
    belief = stage()
    axis = belief.with_changes(sensor={"noise": 3.0 * belief.sensor.noise})
    done = diagnose(belief, [run(axis, there_and_back(20.0))])
    assert done.verdict in ("consistent", "retuned")
    assert any(SAID in note for note in done.notes)


def test_a_jump_of_the_reading_is_no_noise() -> None:
    plant = stage(effects=[{"name": "sensor-jump", "size": 1e-4, "time": 9.0}])
    done = diagnose(stage(), [run(plant, there_and_back(20.0))])
    assert done.effects[0].names == ("sensor-jump",)
    assert not any(SAID in note for note in done.notes)
