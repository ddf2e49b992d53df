"""A belief that leaves as much of recordings of its own has nothing missing; chance beside it counts."""

from __future__ import annotations

import pytest
from joints import MASS, joint, swings
from pendulum import LOAD, balanced, both, stage
from recorded import run, there_and_back

from rtcomp.diagnosis.candidates.screening import look
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.forces.replicate import left_by
from rtcomp.diagnosis.positions.trajectory import Trajectory
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.as_believed import agrees, as_loud, no_more_than_its_own, null_of_belief
from rtcomp.diagnosis.search.replicates import null_of
from rtcomp.diagnosis.settings import LEVEL
from rtcomp.stage.stage import Stage

COUNTS = 1e-4
BELIEF = joint(COUNTS)
DEAD = {"name": "drive-deadband", "width": 0.09}
SPRING = {"name": "parallel-spring", "stiffness": 0.3}


def fitted(plant: Stage) -> tuple[Fitter, Fitted]:
    balance = ForceBalance(BELIEF, load_data([run(plant, swings())]))
    base = baseline(balance)
    return Fitter(balance), base


@pytest.mark.parametrize("hidden", [[], [DEAD], [SPRING]])
def test_a_belief_leaves_more_than_of_its_own_recordings_where_an_effect_is_missing(
    hidden: list[dict[str, float | str]],
) -> None:
    fitter, _ = fitted(joint(COUNTS, MASS, *hidden))
    assert no_more_than_its_own(fitter, BELIEF, 0) == (not hidden)


def test_a_gain_counts_only_where_the_belief_has_none_as_large_by_chance() -> None:
    """What is more than fits of the fit gain is not more than fits of the belief do, which may be true."""
    fitter, base = fitted(BELIEF)
    screen = look(fitter, base).screen
    of_fit = null_of(fitter, base, screen, 0.0, 0)
    null = null_of(fitter, base, screen, of_fit.threshold(0.5 * LEVEL), 0)
    assert null.p_value(of_fit.threshold(0.5 * LEVEL)) > LEVEL
    assert of_fit.numbers is not None and null.numbers is not None
    assert null.numbers[:, 0].mean() == pytest.approx(of_fit.numbers[:, 0].mean(), rel=0.02)


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
    assert (as_loud(fitter, belief, base, null, 3) is not None) == (not hidden)
    assert agrees(fitter, belief, 3) == (not hidden)
