"""Effects that go by the whole of friction, fitted together with it."""

from __future__ import annotations

import numpy as np
import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.balance import ForceBalance
from rtcomp.diagnosis.baseline import baseline
from rtcomp.diagnosis.data import load_data
from rtcomp.diagnosis.fit import Fitter
from rtcomp.diagnosis.free import Term

CREEP = {"name": "creep", "fraction": 0.7, "time_constant": 0.15}


@pytest.fixture(scope="module")
def fitter() -> Fitter:
    """A recording of an axis that creeps much, and the belief that it does not."""
    recording = run(stage(effects=[CREEP]), there_and_back(16.0))
    balance = ForceBalance(stage(), load_data([recording]))
    baseline(balance)
    return Fitter(balance)


@pytest.mark.parametrize("start", [0.2, 0.6, 1.5])
def test_a_strong_creep_is_fitted_from_anywhere(fitter: Fitter, start: float) -> None:
    """Creep goes by the friction that is fitted with it: a recording shows the ratio of both."""
    found = fitter.fit([Term.of({**CREEP, "fraction": start, "time_constant": 0.4})])
    creep = found.entries[0]
    stiffness = sum(e["stiffness"] for e in stage().to_dict()["stage"]["friction"])
    assert creep["time_constant"] == pytest.approx(CREEP["time_constant"], rel=0.1)
    assert creep["fraction"] / found.weights.sum() == pytest.approx(CREEP["fraction"] / stiffness, rel=0.1)
    true = fitter.balance.error(found.entries, found.coefficients, found.weights)
    assert np.sum(true[fitter.rows] ** 2) == pytest.approx(found.sse, rel=0.02)
