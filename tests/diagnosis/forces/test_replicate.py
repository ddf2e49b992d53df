"""Replicates of a model along the recorded motion."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.replicate import left_by, replicate
from rtcomp.diagnosis.positions.windows import Windows
from rtcomp.diagnosis.recordings.data import load_data


def test_a_replicate_of_averaged_rows_is_read_in_counts() -> None:
    """At rest a reading stays at its count, however many rows are averaged."""
    coarse = stage().with_changes(sensor={"noise": 1e-7, "resolution": 1e-6})
    moving = there_and_back(40.0)
    resting = np.where(np.arange(moving.size) % 10_000 < 4000, 0.0, moving)
    data = load_data([run(coarse, resting)], bandwidth=12.0)
    assert data.averaged > 1
    made = replicate(coarse, data, [s.position for s in data.segments], 1e-7, seed=3)
    assert made is not None
    (segment,) = made.segments
    assert segment.source is not None
    counts = segment.source.position / 1e-6
    assert counts == pytest.approx(np.round(counts), abs=1e-6)
    assert segment.position == pytest.approx(
        segment.source.position.reshape(-1, data.averaged).mean(axis=1), abs=1e-12
    )


def test_a_stage_faster_than_any_row_tells_has_no_replicate_and_is_far_off() -> None:
    """Damping on hardly any mass: its simulation would not end, nor listen to Ctrl-C."""
    believed = stage()
    balance = ForceBalance(believed, load_data([run(believed, there_and_back(20.0))]))
    baseline(balance)
    quick = stage(mass=2e-3, micro_damping=1e5)
    assert left_by(quick, balance) is None
    low, high = balance.data.stroke
    assert np.abs(Windows.of(balance).off(quick)) == pytest.approx(high - low)


def test_a_reading_has_the_noise_that_the_sensor_states_beside_its_counts() -> None:
    """At rest counts are no white noise, and a recording has less of it than a twelfth of their square."""
    axis = stage().with_changes(sensor={"noise": 1.5e-8, "resolution": 5e-8})
    data = load_data([run(axis, there_and_back(4.0))])
    segment = data.segments[0]
    made = replicate(axis, data, [segment.position], noise=1.6e-8, seed=3)
    assert made is not None
    jitter = [np.std(np.diff(one.segments[0].position, 3)) for one in (made, data)]
    assert jitter[0] == pytest.approx(jitter[1], rel=0.1)
