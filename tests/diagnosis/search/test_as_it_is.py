"""The belief as it is: where it may have made the recording, chance beside it counts too."""

from __future__ import annotations

import pytest
from joints import MASS, joint, swings
from recorded import run

from rtcomp.diagnosis.candidates.screening import look
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.as_it_is import no_more_than_its_own
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
