"""The step of a sensor is told by its readings; a continuous reading tells none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import recorded
from hypothesis import example, given
from hypothesis import strategies as st

from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.counts import count_of, counted
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.kernels import Floats
from rtcomp.recording.reader import Recording

RATE = 500.0


def recording(position: Floats, **marks: Floats) -> Recording:
    columns = {"time": np.arange(position.size) / RATE, "position": position, "voltage": np.sin(position)}
    return Recording({**columns, **marks}, RATE, {}, Path("run.csv"))


def motion(stroke: float, seed: int) -> Floats:
    """Moves of a second, with noise of a thousandth of the stroke."""
    random = np.random.default_rng(seed)
    stops = stroke * random.uniform(-0.5, 0.5, 9)
    path = np.interp(np.arange(4000), np.arange(9) * 500.0, stops)
    return np.asarray(path + 1e-3 * stroke * random.standard_normal(path.size))


@given(
    stroke=st.floats(1e-6, 1e3),
    counts=st.floats(50.0, 1e6),
    offset=st.floats(-1.0, 1.0),
    seed=st.integers(0, 1000),
)
@example(stroke=1e-6, counts=235939.86010929587, offset=0.0, seed=689)  # half of the few are even
def test_the_count_is_found_whatever_the_stroke(
    stroke: float, counts: float, offset: float, seed: int
) -> None:
    count = stroke / counts
    x = motion(stroke, seed) + offset * stroke
    found = count_of([recording(count * np.round(x / count))])
    # Too fine for the recording to tell, or right: never another.
    assert found == 0.0 or abs(found / count - 1.0) < 1e-3
    assert found > 0.0 or counts > 1e4


@given(stroke=st.floats(1e-6, 1e3), seed=st.integers(0, 1000))
def test_a_continuous_reading_has_none(stroke: float, seed: int) -> None:
    assert count_of([recording(motion(stroke, seed))]) == 0.0


def test_a_file_that_is_rounded_to_fewer_digits_has_counts_still() -> None:
    """A 12-bit encoder (1.534 mrad) written in tenths of a milliradian."""
    count = 2.0 * np.pi / 4096.0
    written = np.round(count * np.round(motion(2.0, 1) / count), 4)
    assert abs(count_of([recording(written)]) / count - 1.0) < 0.01


def test_rows_that_are_marked_do_not_count() -> None:
    count = 1e-3
    x = count * np.round(motion(1.0, 3) / count)
    bad = np.random.default_rng(4).random(x.size) < 0.2
    x[bad] += np.random.default_rng(5).uniform(-1.0, 1.0, int(bad.sum()))
    assert abs(count_of([recording(x, outlier=bad.astype(np.float64))]) / count - 1.0) < 1e-6
    nothing = np.ones(x.size)
    assert count_of([recording(x, outlier=nothing)]) == 0.0


def test_a_reading_that_never_changes_has_none() -> None:
    assert count_of([recording(np.full(1000, 0.3))]) == 0.0


def test_what_the_stage_states_counts() -> None:
    x = 1e-6 * np.round(motion(1e-3, 2) / 1e-6)
    data = load_data([recording(x)])
    stated = recorded.stage().with_changes(sensor={"noise": 0.0, "resolution": 5e-7})
    assert counted(stated, data) == 5e-7
    silent = recorded.stage().with_changes(sensor={"noise": 0.0, "resolution": 0.0})
    assert abs(counted(silent, data) - 1e-6) < 1e-9


def test_rest_counts_no_more_for_a_stage_that_does_not_state_its_sensor() -> None:
    """Where a reading stays within a count, friction goes along with the drive unseen."""
    axis = recorded.stage().with_changes(sensor={"noise": 0.0, "resolution": 1e-6})
    reference = 2e-4 * np.clip(3.0 * np.sin(2.0 * np.pi * 0.3 * np.arange(8000) / recorded.RATE), -1.0, 1.0)
    data = load_data([recorded.run(axis, reference)])
    trusts = []
    for resolution in (1e-6, 0.0):
        balance = ForceBalance(axis.with_changes(sensor={"noise": 3e-7, "resolution": resolution}), data)
        m = balance.stage.mechanics
        balance.whiten(np.array([m.mass, m.viscous, m.micro_damping, 0.0, *balance.weights, 0.0]))
        trusts.append(balance.trust)
    rests = [float(np.mean(trust < 0.5)) for trust in trusts]
    assert rests[0] > 0.05
    assert abs(rests[1] - rests[0]) < 0.02
    without = ForceBalance(balance.stage, replace(data, count=0.0))
    without.whiten(np.array([m.mass, m.viscous, m.micro_damping, 0.0, *without.weights, 0.0]))
    assert np.all(without.trust == 1.0)
