"""The guard over learning: what is learned may not foresee much less than what was kept."""

from __future__ import annotations

import numpy as np
import pytest
from loop_rig import WEIGHTS, device, go, plan, stage, tick

from rtcomp.hysteresis.rls import Rls
from rtcomp.loop import layout as at


def off(weights, axis):
    """How far weights are from the stage's, as forces (N) of the intervals."""
    return np.abs((weights[:4] - np.array(WEIGHTS)) * axis.scales[:4]).max()


def test_a_learner_that_only_follows_noise_is_taken_back_to_the_model_it_was_given():
    """A memory of ten updates for five weights: its weights jump about, and the loop feels each jump."""
    axis = tick(learner=Rls(0.9, trust=1e6))
    axis.adopt_weights(np.append(WEIGHTS, 0.0))
    left = go(device(stage(noise=5e-8)), axis, plan(12_000))
    assert left.outcome.taken_back >= 2 and left.outcome.diverged == 0
    assert np.array_equal(axis.identifier.w_kept, np.append(WEIGHTS, 0.0))


@pytest.mark.parametrize("forgetting", [0.999, 1.0])
def test_a_learner_that_learns_is_left_alone_and_kept(forgetting):
    axis = tick(learner=Rls(forgetting))
    left = go(device(stage(noise=2e-9)), axis, plan(8000))
    assert left.outcome.taken_back == 0 and left.outcome.updates > 7000
    kept = axis.identifier.w_kept
    assert kept.any() and off(kept, axis) < 0.05
    assert np.isfinite(axis.identifier.ls_kept).all()


def test_what_diverges_goes_back_to_what_was_kept_not_to_the_start():
    axis = tick(learner=Rls(0.999), force_bound=400.0)
    left = go(device(stage(noise=2e-9)), axis, plan(5000))
    kept = axis.identifier.w_kept.copy()
    assert kept.any() and left.outcome.diverged == 0
    axis.weights[:] = 1e30
    again = go(device(stage(noise=2e-9)), axis, plan(300))
    assert again.outcome.diverged == 1
    assert off(axis.weights, axis) < 0.5


def test_before_the_comparison_nothing_is_judged():
    """The first updates of a learner are rough, and no sign of anything."""
    axis = tick(learner=Rls(0.9, trust=1e6))
    axis.adopt_weights(np.append(WEIGHTS, 0.0))
    left = go(device(stage(noise=5e-8)), axis, plan(int(at.COMPARED)))
    assert left.outcome.taken_back == 0
    assert axis.state[at.TRIED] == left.outcome.updates
