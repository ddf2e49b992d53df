"""Identify: the paper's stage, judged frozen on other motion; from recordings, measured ones too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rtcomp.errors import ConfigError, RecordingError
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.follow import follow
from rtcomp.jobs.identify import friction, friction_level, identify
from rtcomp.jobs.judge import judge, learning_curve, reached
from rtcomp.loop.tick import COLUMNS
from rtcomp.recording.reader import read

ROOT = Path(__file__).parents[2]
SHORT = {"kind": "triangle", "amplitude": 6e-5, "frequency": 1.0, "duration": 3.0}


def test_held_out_error_of_the_simulated_stage(identified):
    assert identified.held_out.relative < 0.015
    assert identified.in_sample.relative < 0.03
    assert friction_level(identified.model) == pytest.approx(4.7, rel=0.03)
    assert not identified.notes and (identified.model.reached > 0.9).all()


def test_three_cycles_are_enough_for_two_per_cent(leuven):
    done = identify(leuven.changed(reference=SHORT))
    assert done.run.outcome.ticks == 3000
    assert done.held_out.relative < 0.02


def test_without_noise_one_cycle_is_enough(leuven):
    config = leuven.changed(sensor={"noise": 0.0, "resolution": 0.0}, reference={**SHORT, "duration": 1.25})
    assert identify(config).held_out.relative < 0.015


def test_the_weights_are_the_slopes_of_the_stage_s_virgin_curve(identified, leuven):
    travel, force = identified.model.virgin_curve()
    elements = leuven.stage.friction.elements
    true = sum(k * np.minimum(travel, r) for k, r in elements)
    assert np.abs(force - true).max() < 0.03 * true[-1]
    assert (np.diff(identified.model.weights) <= 1e-6 * identified.model.weights[0]).all()  # the prior


def test_the_judgement_is_on_frozen_weights_and_all_of_the_motion(identified):
    judged = identified.held_out
    assert judged.friction.time[-1] == pytest.approx(10.0, abs=0.01)
    again = judge(identified.model, judged.friction)
    assert again.relative == judged.relative
    # Worth something: forgetting half the weights is seen at once.
    worse = HysteresisModel(identified.model.basis, identified.model.weights * 0.9)
    assert judge(worse, judged.friction).relative > 2 * judged.relative


def test_the_learning_curve_is_the_judgement_of_each_set_of_weights(identified):
    run, offset = identified.run, identified.run.tick.offset_scale
    for m in (0, len(run.weights) // 2, -1):
        model = HysteresisModel(identified.model.basis, run.weights[m, :-1], run.weights[m, -1] * offset)
        judged = judge(model, identified.held_out.friction)
        assert identified.curve[m] == pytest.approx(judged.relative, rel=1e-6)
    assert identified.curve[-1] < 0.1 * identified.curve[0]
    assert identified.curve_time.shape == identified.curve.shape


def test_measured_friction_is_the_friction_of_the_simulation(leuven):
    """What is taken for friction, against what the simulation itself says it was."""
    config = leuven.changed(sensor={"noise": 0.0, "resolution": 0.0})
    run = follow(config, "judge")
    found = friction(config, run)
    bank = config.stage.friction
    p, s = bank.vector(), bank.initial_state()
    from rtcomp.physics import wires

    true = np.zeros(found.position.size)
    wire = np.zeros(wires.COUNT)
    wire[wires.REACH] = wire[wires.SCALE] = 1.0
    for k, moved in enumerate(np.diff(found.position, prepend=found.position[0])):
        wire[wires.MOVED], wire[wires.FRICTION] = moved, 0.0
        bank.kernel(p, s, wire)
        true[k] = wire[wires.FRICTION]
    error = np.sqrt(np.mean((found.force - true)[50:-50] ** 2))
    assert error < 0.01 * np.abs(true).max()


@pytest.mark.parametrize("device", [{"driver": "simulated"}, {"driver": "simulated", "delay_ticks": 1}])
def test_a_tick_of_delay_costs_nothing(leuven, device):
    done = identify(leuven.changed(device=device, reference=SHORT))
    assert done.run.delay_ticks == device.get("delay_ticks", 0)
    assert done.held_out.relative < 0.02


def test_nothing_is_learned_outside_the_window(leuven):
    section = {**leuven.file.data["identify"], "learn": [0.5, 1.5]}
    run = identify(leuven.changed(reference=SHORT, identify=section)).run
    time, learning = run.columns["time"], run.columns["learning"] > 0
    assert learning.any() and time[learning].min() >= 0.5 and time[learning].max() <= 1.5
    late = run.weights_time > 1.6
    assert late.any() and (run.weights[late] == run.weights[late][0]).all()
    assert not run.weights[run.weights_time < 0.49].any()


def test_intervals_that_were_never_reached_are_zero_and_said(leuven):
    section = {**leuven.file.data["identify"], "range": 1e-3}
    done = identify(leuven.changed(reference=SHORT, identify=section))
    unreached = done.model.reached == 0
    assert unreached.any() and not done.model.weights[unreached].any()
    assert "never reached" in done.notes[0] and f"to {done.model.basis.size} of" in done.notes[0]


def test_reached_is_the_share_of_each_amplitude():
    from rtcomp.hysteresis.interval import IntervalBasis

    motion = np.concatenate([np.linspace(0, 1.5, 50), np.linspace(1.5, 0, 50)])
    assert reached(IntervalBasis([1.0, 2.0, 4.0]), motion) == pytest.approx([1.0, 0.5, 0.0])


def test_the_learning_curve_agrees_with_the_matrix_it_avoids():
    rng = np.random.default_rng(0)
    from rtcomp.hysteresis import regressors
    from rtcomp.hysteresis.interval import IntervalBasis
    from rtcomp.jobs.judge import Friction

    basis = IntervalBasis([0.5, 1.0])
    t = np.arange(200) * 0.01
    x = np.sin(7 * t)
    force = rng.normal(0.0, 1.0, 200)
    history = rng.normal(0.0, 1.0, (4, 3))
    curve = learning_curve(basis, history, 0.7, Friction(t, x, force, np.ones(200, bool)), (0.5, 1.5), 0.1)
    rows = (t >= 0.6) & (t <= 1.5)
    for w, found in zip(history, curve, strict=True):
        model = regressors(basis, x) @ w[:2] + 0.7 * w[2]
        expected = np.sqrt(np.mean((force - model)[rows] ** 2)) / np.abs(force[rows]).max()
        assert found == pytest.approx(expected)


def test_recorded_and_in_memory_are_the_same_run(leuven, tmp_path):
    config = leuven.changed(reference=SHORT)
    plain, recorded = identify(config), identify(config, out=tmp_path)
    assert (tmp_path / "recording.h5").exists() and (tmp_path / "judge.h5").exists()
    for name in set(COLUMNS) - {"execution_us"}:
        assert np.array_equal(plain.run.columns[name], recorded.run.columns[name]), name
    assert np.array_equal(plain.model.weights, recorded.model.weights)
    assert np.array_equal(plain.run.weights, recorded.run.weights)
    assert plain.summary() == recorded.summary()


def test_from_its_own_recording_it_learns_the_same(leuven, identified, tmp_path):
    follow(leuven, "", path=tmp_path / "recording.h5")
    recording = read(tmp_path / "recording.h5")
    data = dict(leuven.file.data)
    config = leuven.changed(judge={"window": [6.0, 10.0]}, identify={**data["identify"], "learn": [0.0, 5.0]})
    done = identify(config, recording)
    assert done.held_out.relative < 0.015
    true = sum(k * r for k, r in leuven.stage.friction.elements)
    assert friction_level(done.model) == pytest.approx(true, rel=0.04)
    # Tick by tick through the same loop: position and command are those of the recording.
    assert np.array_equal(done.run.columns["position"], recording.position)
    assert np.array_equal(done.run.columns["voltage"], recording.voltage)


def test_windows_that_a_recording_does_not_have_are_refused(leuven, tmp_path):
    follow(leuven.changed(reference=SHORT), "", path=tmp_path / "recording.h5")
    recording = read(tmp_path / "recording.h5")
    with pytest.raises(RecordingError, match=r"judge\.window, 20 to 30 s") as caught:
        identify(leuven.changed(judge={"window": [20.0, 30.0]}), recording)
    assert "\n" not in str(caught.value)


def test_a_measured_joint(shared_data):
    """Gear joint of a head: learned on amplitudes up to 0.25 N m, judged frozen on 0.30 N m."""
    config = Configuration.load(ROOT / "configs" / "heads_yaw.yaml")
    file = next((shared_data / "real" / "heads-yaw").glob("*.csv.gz"))
    recording = read(file, config.run.recording.map, rate_hz=config.run.recording.rate)
    assert any("resampled" in note for note in recording.notes)
    done = identify(config, recording)
    assert done.in_sample.rms <= 0.0245
    # Beyond what was learned from: the last intervals were never reached.
    assert done.held_out.relative < 0.15
    assert (np.diff(done.model.weights) <= 1e-9 * done.model.weights.max()).all()


def test_intervals_place_themselves_in_the_loop(leuven, tmp_path):
    """From equal intervals over a range far too large to a model as good as one laid out by hand."""
    section = {**leuven.file.data["identify"], "range": 1e-3, "spacing": 1.0}
    equal = identify(leuven.changed(identify=section))
    done = identify(leuven.changed(identify={**section, "model": "self-placing"}), out=tmp_path)
    assert done.held_out.relative < 0.5 * equal.held_out.relative and done.held_out.relative < 0.02
    basis = done.model.basis
    assert basis.name == "interval" and basis.size == 20 and basis.widths.sum() == pytest.approx(1e-3)
    assert np.count_nonzero(done.model.reached) > 2 * np.count_nonzero(equal.model.reached)
    # The curve is of the intervals as they lay at each moment, and ends at the model without its prior.
    assert done.run.weights.shape[1] == 2 * 20 + 1
    assert np.allclose(done.run.weights[:, 21:].sum(axis=1), 1e-3)
    assert len(np.unique(done.run.weights[:, 21], axis=0)) > 1
    assert done.curve[-1] < 0.03 and done.curve[-1] < 0.1 * done.curve[0]
    again = HysteresisModel.from_dict(done.model.to_dict())
    assert np.array_equal(again.weights, done.model.weights)


def test_a_model_s_intervals_go_on_moving_where_that_is_asked_for(leuven):
    config = leuven.changed(identify={**leuven.file.data["identify"], "model": "self-placing"})
    from rtcomp.hysteresis.interval import IntervalBasis

    given = IntervalBasis([1e-6, 4e-6])
    assert config.moving(given).name == "self-placing"
    assert np.array_equal(config.moving(given).widths, given.widths)
    assert leuven.moving(given) is given


def test_more_intervals_than_can_move_are_refused_in_one_line(leuven):
    section = {**leuven.file.data["identify"], "model": "self-placing", "intervals": 1001}
    with pytest.raises(ConfigError, match=r"leuven.yaml:\d+.*1001 intervals; allowed are 1 to 1000"):
        leuven.changed(identify=section).basis()
