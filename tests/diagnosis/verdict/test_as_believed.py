"""A belief that leaves as much of recordings of its own has nothing missing."""

from __future__ import annotations

import pytest
from pendulum import LOAD, balanced, both, stage
from recorded import run, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.replicate import left_by
from rtcomp.diagnosis.positions.trajectory import Trajectory
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.as_it_is import null_of_belief
from rtcomp.diagnosis.search.selection import Search
from rtcomp.diagnosis.settings import LEVEL
from rtcomp.diagnosis.verdict.as_believed import agrees, as_loud
from rtcomp.stage.stage import Stage


@pytest.mark.parametrize(("hidden", "enough"), [([], True), ([LOAD], False)])
def test_only_what_a_belief_does_not_do_itself_is_looked_for(
    hidden: list[dict[str, object]], enough: bool
) -> None:
    belief = stage()
    fitter = Trajectory.of(balanced(belief, both(stage(*hidden))), belief)
    null = null_of_belief(fitter.balance, belief, lambda data: fitter.on(data).left_as_believed(), 3)
    assert null is not None
    assert (null.p_of_error(fitter.left_as_believed()) > LEVEL) == enough
    assert not fitter.as_believed().coefficients.any()


RINGING = {
    "stage": {
        "mass": 1.4, "force_constant": 8.0, "voltage_limit": 1.6, "viscous": 17.4,
        "friction": [
            {"stiffness": 3.7e6, "reach": 3.9e-7}, {"stiffness": 9e5, "reach": 8.7e-7},
            {"stiffness": 4.2e5, "reach": 2e-6}, {"stiffness": 2.6e5, "reach": 1e-5},
        ],
    },
    "sensor": {"noise": 1.8e-8, "resolution": 5e-8},
    "controller": {"kp": 2450.0, "ki": 5.8e4, "kd": 14.0},
    "rate": 1000.0,
}  # fmt: skip
"""An axis that rings on its friction at 300 Hz, where the sensor's noise is louder than it."""


@pytest.mark.parametrize("hidden", [[], [{"name": "parallel-spring", "stiffness": 2e4}]])
def test_what_rings_beyond_the_bandwidth_is_no_missing_physics(hidden: list[dict[str, object]]) -> None:
    """To a fit it is damping: replicates of the fitted stage ring less, and those of the belief as much."""
    belief = Stage.from_dict(RINGING)
    plant = Stage.from_dict({**RINGING, "stage": {**RINGING["stage"], "effects": hidden}})
    balance = ForceBalance(belief, load_data([run(plant, 0.3 * there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    of_fit = left_by(fitter.stage(base), balance)
    assert of_fit is not None
    null = null_of_belief(balance, belief, lambda data: fitter.on(data).fit([]).errors, 3)
    assert null is not None
    assert fitter.on(of_fit).fit([]).errors.sum() < 0.75 * base.errors.sum()
    assert null.as_loud(base.errors, LEVEL) == (not hidden)
    assert (as_loud(fitter, belief, Search(base, base, null), 3) is not None) == (not hidden)
    assert agrees(fitter, belief, 3) == (not hidden)
