"""Compensate: the same controller with and without; live; replay and simulation of the same stage."""

from __future__ import annotations

import numpy as np
import pytest
from rtcomp_drivers.simulated import SimulatedDriver

from rtcomp.errors import RecordingError
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.jobs.compensate import Tracking, compensate, live
from rtcomp.jobs.plan import ReferencePlan
from rtcomp.jobs.replay import replay
from rtcomp.jobs.session import make_device, make_tick
from rtcomp.jobs.simulate import closed_loop, on_reference, open_loop
from rtcomp.loop.clock import VirtualClock
from rtcomp.loop.ring import Ring
from rtcomp.loop.run import run as run_loop
from rtcomp.loop.tick import COLUMNS
from rtcomp.recording.reader import read

BRIEF = {
    "kind": "multisine",
    "frequencies": [0.3, 0.8, 2.1],
    "amplitudes": [2e-4, 6e-5, 1.5e-5],
    "duration": 6.0,
}


@pytest.mark.parametrize("delay", [0, 1])
def test_the_tracking_error_falls_at_least_twentyfold(leuven, identified, delay):
    config = leuven.changed(
        device={"driver": "simulated", "delay_ticks": delay}, compensate={"reference": BRIEF, "settle": 1.0}
    )
    done = compensate(config, identified.model)
    assert done.improvement > 20
    assert done.error_with.peak < done.error_without.peak
    assert not done.without.columns["feedforward"].any() and done.with_it.columns["feedforward"][1:].any()
    assert done.model is identified.model
    for run in (done.without, done.with_it):
        assert run.outcome.ticks == 6000 and run.delay_ticks == delay


def test_what_a_device_says_of_itself_is_passed_on(leuven, identified, monkeypatch):
    class Loose(SimulatedDriver):
        def open(self):
            super().open()
            self.remarks = ["runs without watchdog"]

    monkeypatch.setattr("rtcomp_drivers.simulated.SimulatedDriver", Loose)
    done = compensate(leuven.changed(compensate={"reference": {**BRIEF, "duration": 2.0}}), identified.model)
    assert done.notes == done.summary()["notes"] == ["runs without watchdog"]


def test_a_lost_slot_costs_moments_not_seconds(leuven, identified):
    """Feedforward goes and comes back; what the integral carried meanwhile it must not go on carrying."""

    class LateOnce(VirtualClock):
        def wait(self, tick):
            return 1.2 * leuven.period if tick == 2000 else 0.0

    config = leuven.changed(compensate={"reference": BRIEF})
    errors = []
    for clock in (VirtualClock(), LateOnce()):
        device = make_device(config)
        tick = make_tick(config, device.delay_ticks, identified.model)
        plan = ReferencePlan(
            config.reference("compensate"), config.stage, config.period, 5000, feedforward_from=0.0
        )
        ring = Ring.create(5001, tick.row_width)
        assert run_loop(device, tick, plan, clock, ring).lost == (1 if isinstance(clock, LateOnce) else 0)
        rows = ring.take()
        ring.release()
        reference, position = (rows[:, COLUMNS.index(name)] for name in ("reference", "position"))
        errors.append(np.abs(reference - position))
    quiet, late = errors
    assert late[2000:].max() < 10 * quiet[1000:].max()
    assert late[2300:].max() < 2 * quiet[1000:].max()


def test_the_comparison_is_of_one_reference_one_noise_one_controller(leuven, identified):
    done = compensate(leuven.changed(compensate={"reference": BRIEF}), identified.model)
    for name in ("time", "reference"):
        assert np.array_equal(done.without.columns[name], done.with_it.columns[name])
    assert done.improvement == pytest.approx(done.error_without.rms / done.error_with.rms)
    time, error = done.with_it.tracking_error(1.0)
    assert time[0] >= 1.0 and done.error_with.rms == pytest.approx(np.sqrt(np.mean(error**2)))
    assert Tracking.of(done.with_it, 1.0) == done.error_with


def test_a_model_of_nothing_helps_little(leuven, identified):
    """The gain is the hysteresis model's: feedforward of inertia alone brings next to none."""
    empty = HysteresisModel(identified.model.basis, np.zeros(identified.model.basis.size))
    config = leuven.changed(compensate={"reference": BRIEF})
    assert compensate(config, empty).improvement < 2


def test_learning_on_while_compensating_mends_a_bad_model(leuven, identified):
    bad = HysteresisModel(identified.model.basis, 0.5 * identified.model.weights)
    fixed = leuven.changed(compensate={"reference": BRIEF, "settle": 3.0})
    learning = leuven.changed(compensate={"reference": BRIEF, "settle": 3.0, "learn": True})
    without, with_it = compensate(fixed, bad), compensate(learning, bad)
    assert with_it.improvement > 5 * without.improvement
    assert np.abs(with_it.model.weights - bad.weights).max() > 1e3


@pytest.mark.parametrize("times", [1.0, 2.0], ids=["good", "twice too strong"])
def test_learning_on_begins_with_what_it_was_given(leuven, identified, times):
    """A learner that took a given model for nothing made the feedforward jump, and the peak twice as high."""
    given = HysteresisModel(identified.model.basis, times * identified.model.weights, identified.model.offset)
    frozen = compensate(leuven, identified.model)
    learning = compensate(leuven.changed(compensate={**leuven.file.data["compensate"], "learn": True}), given)
    assert learning.error_with.rms < frozen.error_with.rms
    assert learning.error_with.peak < frozen.error_with.peak
    steps = [np.abs(np.diff(run.with_it.columns["feedforward"])).max() for run in (frozen, learning)]
    assert steps[1] < 1.5 * steps[0]
    assert learning.with_it.outcome.taken_back == 0


def test_live_the_error_falls_when_the_feedforward_comes(leuven):
    run = live(leuven, 5.0, 0.5)
    time, error = run.tracking_error()
    before, after = (np.sqrt(np.mean(error[(time >= a) & (time < b)] ** 2)) for a, b in ((2, 5), (6, 9)))
    assert before > 8 * after
    share = run.columns["feedforward"]
    assert not share[run.columns["time"] < 5.0].any()
    assert np.abs(np.diff(run.columns["voltage"]))[4990:5600].max() < 1.0


def test_replay_of_its_own_recording_balances(leuven, tmp_path):
    closed_loop(leuven, path=tmp_path / "run.h5")
    recording = read(tmp_path / "run.h5")
    done = replay(leuven.stage, recording)
    assert done.relative_force_error < 0.02
    assert set(done.columns) >= {
        "time", "voltage", "position", "force_drive", "force_motion", "position_simulated",
        "voltage_simulated",
    }  # fmt: skip
    assert np.array_equal(done.columns["position"], recording.position)
    # Simulated on the recorded reference, with noise of its own: the same motion but for the noise.
    assert done.position_error_rms < 5e-7
    assert np.ptp(recording.position) > 1e-4


def test_replay_shows_a_stage_that_is_believed_wrong(leuven, tmp_path):
    closed_loop(leuven, path=tmp_path / "run.h5")
    recording = read(tmp_path / "run.h5")
    weak = leuven.stage.with_changes(stage={"force_constant": 3.6})
    assert replay(weak, recording).relative_force_error == pytest.approx(0.1, abs=0.02)


def test_replay_without_reference_or_controller_does_not_simulate(leuven, tmp_path):
    closed_loop(leuven, path=tmp_path / "run.h5")
    full = np.column_stack([read(tmp_path / "run.h5").columns[n] for n in ("time", "position", "voltage")])
    path = tmp_path / "run.csv"
    np.savetxt(path, full, delimiter=",", header="time,position,voltage", comments="", fmt="%.17g")
    done = replay(leuven.stage, read(path))
    assert done.relative_force_error < 0.02
    assert done.position_error_rms is None and "position_simulated" not in done.columns


def test_a_recording_of_a_few_rows_is_refused(leuven, tmp_path):
    path = tmp_path / "short.csv"
    t = np.arange(40) * 1e-3
    rows = np.column_stack([t, 1e-5 * np.sin(50 * t), np.cos(50 * t)])
    np.savetxt(path, rows, delimiter=",", header="time,position,voltage", comments="")
    with pytest.raises(RecordingError, match="40 rows"):
        replay(leuven.stage, read(path))


def test_simulations_in_closed_and_open_loop_are_one_stage(leuven):
    """The voltages of a closed-loop run, played open loop from the same start, move the stage alike."""
    quiet = leuven.changed(sensor={"noise": 0.0, "resolution": 0.0})
    closed = closed_loop(quiet)
    opened = open_loop(quiet, closed.columns["voltage"])
    assert np.allclose(opened.columns["position"], closed.columns["position"], rtol=0, atol=1e-10)
    again = on_reference(quiet, closed.columns["reference"], 0.0)
    assert np.allclose(again.columns["position"], closed.columns["position"], rtol=0, atol=1e-12)


def test_half_the_integration_step_changes_nothing_that_matters(leuven):
    quiet = leuven.changed(sensor={"noise": 0.0, "resolution": 0.0})
    one, two = closed_loop(quiet), closed_loop(quiet, substeps=2.0)
    for name in ("position", "voltage"):
        a, b = one.columns[name], two.columns[name]
        assert np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)) < 1e-3


def test_open_loop_begins_where_it_is_told(leuven):
    run = open_loop(leuven, np.zeros(100), start=3e-4)
    assert np.allclose(run.columns["position"], 3e-4, rtol=0, atol=1e-7)
    assert not run.columns["voltage"].any()
