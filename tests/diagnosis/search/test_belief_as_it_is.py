"""Judged by positions, a belief that leaves no more than on recordings of its own has nothing missing."""

from __future__ import annotations

import pytest
from pendulum import LOAD, balanced, both, stage

from rtcomp.diagnosis.positions.trajectory import Trajectory
from rtcomp.diagnosis.search.replicates import null_of_belief
from rtcomp.diagnosis.settings import LEVEL


@pytest.mark.parametrize(("hidden", "enough"), [([], True), ([LOAD], False)])
def test_only_what_a_belief_does_not_do_itself_is_looked_for(
    hidden: list[dict[str, object]], enough: bool
) -> None:
    belief = stage()
    fitter = Trajectory.of(balanced(belief, both(stage(*hidden))), belief)
    null = null_of_belief(fitter, 3)
    assert null is not None
    assert (null.p_of_error(fitter.left_as_believed()) > LEVEL) == enough
    assert not fitter.as_believed().coefficients.any()
