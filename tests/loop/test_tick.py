"""The tick against its description written out in plain Python; what force goes with what position."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_rig import (
    CONSTANT,
    MASS,
    VISCOUS,
    WEIGHTS,
    WIDTHS,
    device,
    go,
    plan,
    stage,
    tick,
)

from rtcomp.control.limits import limit_state, limit_step, limit_vector
from rtcomp.control.pid import pid_state, pid_step, pid_vector
from rtcomp.errors import LimitError
from rtcomp.hysteresis.basis import regressors
from rtcomp.hysteresis.conditioning import low_pass, memory, settle, smooth
from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.lms import Lms
from rtcomp.hysteresis.rls import Rls
from rtcomp.loop.run import warm_up
from rtcomp.loop.tick import FEEDFORWARD, KNOWN, LEAD_FORCE, LEAD_POSITION, LEARN, LET_GO, REFERENCE


def written_out(table, position, *, delay, smoothing, gate, learner, start, period=1e-3):
    """What the tick does, in order, with arrays and sums; commands, forces, model forces and weights."""
    basis = IntervalBasis(WIDTHS)
    n = basis.size
    scales = np.append(basis.scales(), basis.scales().mean())
    p, s, w = learner.vector(scales), learner.initial_state(scales), np.array(start, dtype=float)
    state, x = basis.initial_state(), np.append(np.zeros(n), scales[n])
    lead_state, lead_x = basis.initial_state(), np.append(np.zeros(n), scales[n])
    sections = low_pass(smoothing, 1.0 / period)
    of_position, of_force = memory(sections), memory(sections)
    settle(sections, of_position, position[0])
    pid, pid_s = pid_vector(2e4, 2e5, 100.0, period=period, voltage_limit=10.0), pid_state()
    limit, limit_s = limit_vector(10.0, period), limit_state()
    learned_at, excess = position[0], 0.0
    volts = np.zeros(len(position))
    force, model = np.zeros(len(position)), np.zeros(len(position))
    weights = np.zeros((len(position), n + 1))
    for k in range(len(position)):
        if k >= 2 + delay:
            # The command of tick j acts from tick j + delay on; around sample k - 1: before it, after it.
            acted = 0.5 * (volts[k - 2 - delay] + volts[k - 1 - delay])
            f = CONSTANT * acted - table[k, KNOWN]
            f -= MASS * (position[k] - 2 * position[k - 1] + position[k - 2]) / period**2
            f -= VISCOUS * (position[k] - position[k - 2]) / (2 * period)
            at = smooth(sections, of_position, position[k - 1])
            f = smooth(sections, of_force, f)
            basis.kernel(basis.vector(), state, x, at)
            force[k], model[k] = f, w @ x
            if table[k, LEARN] and abs(at - learned_at) >= gate:
                learned_at = at
                learner.kernel(p, s, x, w, f - w @ x)
        feedback = pid_step(pid, pid_s, table[k, REFERENCE] - position[k], position[k], excess)
        basis.kernel(basis.vector(), lead_state, lead_x, table[k, LEAD_POSITION])
        feedforward = table[k, FEEDFORWARD] * (table[k, LEAD_FORCE] + w @ lead_x) / CONSTANT
        volts[k] = limit_step(limit, limit_s, feedback + feedforward)
        excess = volts[k] - feedback - feedforward
        weights[k] = w
    return volts, force, model, weights


@settings(max_examples=12, deadline=None)
@given(
    st.sampled_from([0, 1]),
    st.sampled_from([0.0, 80.0]),
    st.sampled_from([0.0, 1e-7]),
    st.sampled_from([Rls(0.999), Lms(0.05)]),
    st.floats(0.0, 1.0),
    st.integers(0, 1000),
)
def test_the_tick_does_what_its_description_says(delay, smoothing, gate, learner, share, seed):
    rng = np.random.default_rng(seed)
    the_plan = plan(120, share=share)
    the_plan.table[:, KNOWN] = rng.normal(0.0, 0.1, 120)
    the_plan.table[:, LEARN] = rng.random(120) < 0.7
    start = np.append(WEIGHTS, 0.0) * rng.uniform(0.5, 1.5, 5)
    left = go(
        device(stage(noise=5e-9), delay=delay, seed=seed),
        tick(delay=delay, smoothing=smoothing, gate=gate, learner=learner, weights=start),
        the_plan,
    )
    volts, force, model, weights = written_out(
        the_plan.table, left.column("position"), delay=delay, smoothing=smoothing, gate=gate,
        learner=learner, start=start,
    )  # fmt: skip
    # Sums in another order differ in the last bits; a learner that is as yet wrong makes ten thousand million
    # times more of it in a tenth of a second.
    assert np.allclose(left.column("voltage"), volts, rtol=0, atol=1e-3)
    assert np.allclose(left.column("force"), force, rtol=0, atol=1e-3)
    assert np.allclose(left.column("force_model"), model, rtol=0, atol=1e-3)
    assert np.allclose(left.weights, weights, rtol=0, atol=1e-3 * max(WEIGHTS))
    assert np.allclose(left.column("feedforward") + left.column("feedback"), volts, rtol=0, atol=1e-3)


@pytest.mark.parametrize("delay", [0, 1])
def test_force_and_position_are_paired_right_whatever_the_delay(delay):
    """Identified weights are those of the stage, with the device's delay told; not told, they are not."""
    learned = go(device(stage(), delay=delay), tick(delay=delay), plan(4000))
    found = learned.tick.weights[:4]
    assert np.allclose(found, WEIGHTS, rtol=0.01)
    told_wrong = go(device(stage(), delay=delay), tick(delay=1 - delay), plan(4000)).tick.weights[:4]
    assert np.abs(told_wrong / WEIGHTS - 1).max() > 3 * np.abs(found / WEIGHTS - 1).max()


def test_weights_of_both_delays_agree():
    found = [go(device(stage(), delay=d), tick(delay=d), plan(4000)).tick.weights[:4] for d in (0, 1)]
    assert np.allclose(found[0], found[1], rtol=0.01)


def test_learning_off_leaves_the_weights_to_the_last_bit():
    start = np.append(WEIGHTS, 123.0) * 1.1
    left = go(device(stage()), tick(weights=start), plan(500, learn=False, share=1.0))
    assert np.array_equal(left.tick.weights, start)
    assert (left.weights == start).all()
    assert left.outcome.updates == 0 and not left.column("learning").any()
    assert left.column("force_model").any()  # what it would have said is still recorded


def test_learning_is_driven_by_displacement():
    gate = 5e-7
    left = go(device(stage()), tick(gate=gate), plan(2000))
    learning = left.column("learning") > 0
    at = left.column("position")[np.flatnonzero(learning) - 1]  # the sample before is what was learned from
    assert (np.abs(np.diff(at)) >= gate).all()
    assert 0 < left.outcome.updates < 1500
    still = plan(2000)
    still.table[500:] = still.table[500]
    rested = go(device(stage()), tick(gate=gate), still)
    assert not rested.column("learning")[1200:].any()


def test_a_constant_force_is_learned_as_the_offset():
    pull = {"name": "constant-force", "force": -0.5}
    the_stage = stage().with_changes(stage={"effects": [pull]})
    left = go(device(the_stage), tick(), plan(4000))
    assert left.tick.weights[4] * left.tick.offset_scale == pytest.approx(0.5, abs=0.02)
    assert np.allclose(left.tick.weights[:4], WEIGHTS, rtol=0.02)
    without = go(device(the_stage), tick(offset=False), plan(500))
    assert without.tick.weights[4] == 0.0 and without.tick.offset_scale == 0.0


def test_feedforward_fades_in_without_a_jump():
    the_plan = plan(1500, learn=False)
    share = np.clip((np.arange(1500) - 600) / 200, 0.0, 1.0)
    the_plan.table[:, FEEDFORWARD] = share
    left = go(device(stage()), tick(weights=np.append(WEIGHTS, 0.0)), the_plan)
    feedforward = left.column("feedforward")
    assert not feedforward[:601].any() and feedforward[601:].all()
    full = go(device(stage()), tick(weights=np.append(WEIGHTS, 0.0)), plan(1500, learn=False, share=1.0))
    assert np.allclose(feedforward, share * full.column("feedforward"), rtol=0, atol=1e-12)
    error = np.abs(left.column("reference") - left.column("position"))
    assert error[900:].max() < 0.2 * error[:600].max()
    steps = np.abs(np.diff(left.column("voltage")))
    assert steps[595:805].max() < 2 * steps[300:595].max()


def test_what_was_followed_before_the_run_is_remembered():
    """Two pieces of one motion are fed forward as the whole is."""
    before = 4e-5 * np.sin(0.02 * np.arange(700))
    the_plan, the_tick = plan(300, learn=False, share=1.0), tick(weights=np.append(WEIGHTS, 0.0))
    the_tick.remember(before)
    found = go(device(stage()), the_tick, the_plan).column("feedforward")
    basis = IntervalBasis(WIDTHS)
    whole = regressors(basis, np.concatenate([before, the_plan.table[:, LEAD_POSITION]]))[700:] @ WEIGHTS
    assert np.allclose(found, (the_plan.table[:, LEAD_FORCE] + whole) / CONSTANT, rtol=0, atol=1e-12)
    virgin = go(device(stage()), tick(weights=np.append(WEIGHTS, 0.0)), plan(300, learn=False, share=1.0))
    assert np.abs(found - virgin.column("feedforward")).max() > 0.1


def test_an_axis_that_is_let_go_comes_to_rest_without_a_swing():
    """Its command dies out whatever feedback asks for, and it springs back no further than it then stands."""
    the_plan = plan(2500, learn=False, share=1.0)
    the_plan.table[1500:, [REFERENCE, LEAD_POSITION]] = the_plan.table[1500, REFERENCE]
    the_plan.table[1500:, LEAD_FORCE] = 0.0
    the_plan.table[:, LET_GO] = np.clip((np.arange(2500) - 2000) / 300, 0.0, 1.0)
    left = go(device(stage()), tick(weights=np.append(WEIGHTS, 0.0)), the_plan)
    volts, position = left.column("voltage"), left.column("position")
    assert abs(volts[1999]) > 0.1 and not volts[2301:].any()
    back = np.abs(position[2000:] - position[1999])
    assert back[-1] > 3e-7 and back.max() < 1.05 * back[-1]


def test_right_weights_cancel_the_friction():
    without = go(device(stage()), tick(), plan(3000, learn=False))
    right = go(device(stage()), tick(weights=np.append(WEIGHTS, 0.0)), plan(3000, learn=False, share=1.0))
    off = [np.std((r.column("reference") - r.column("position"))[500:]) for r in (without, right)]
    assert off[0] > 20 * off[1]


def test_open_loop_sends_the_plan_s_voltages_and_no_feedback():
    the_plan = plan(500, volts=0.0)
    the_plan.table[:, 6] = 1.5 * np.sin(0.02 * np.arange(500))
    left = go(device(stage()), tick(closed_loop=False), the_plan)
    assert np.array_equal(left.column("voltage"), the_plan.table[:, 6])
    assert left.device.commands[-1] == 0.0


def test_commands_keep_to_the_limits_whatever_is_asked():
    asked = plan(400, share=1.0, learn=False)
    asked.table[:, LEAD_FORCE] += 1e3 * np.sign(np.sin(0.05 * np.arange(400)))
    left = go(device(stage()), tick(), asked)
    assert np.abs(left.column("voltage")).max() == 10.0
    assert np.isfinite(left.column("voltage")).all() and np.isfinite(left.column("position")).all()


def test_a_command_that_is_no_number_ends_the_run_at_zero_volts_in_its_tick():
    asked = plan(400, share=1.0, learn=False)
    asked.table[200, LEAD_FORCE] = np.nan
    left = go(device(stage()), tick(weights=np.append(WEIGHTS, 0.0)), asked, error=LimitError)
    assert "the command is no number at tick 200" in str(left.outcome)
    assert len(left.rows) == 201 and left.column("voltage")[199] != 0.0 == left.column("voltage")[200]
    assert left.device.commands[-1] == 0.0 and len(left.device.commands) == 202


def test_warming_up_leaves_no_trace():
    fresh, warmed = tick(delay=1), tick(delay=1)
    warm_up(warmed)
    for name in ("weights", "state", "row"):
        assert np.array_equal(getattr(fresh, name), getattr(warmed, name), equal_nan=True)
    for part in ("identifier", "compensator"):
        for a, b in zip(getattr(fresh, part), getattr(warmed, part), strict=True):
            assert np.array_equal(a, b)
