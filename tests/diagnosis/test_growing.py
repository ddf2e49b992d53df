"""Growing a model by its best candidates: in the form that fits, where first order does not tell forms."""

from __future__ import annotations

import math

import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.balance import ForceBalance
from rtcomp.diagnosis.baseline import baseline
from rtcomp.diagnosis.data import load_data
from rtcomp.diagnosis.fit import Fitter
from rtcomp.diagnosis.growing import grow
from rtcomp.diagnosis.selection import look

STRIBECK = {"name": "stribeck", "rise": 0.4, "velocity": 1.5e-3}


@pytest.mark.parametrize("following", [0.0, 1.0])
def test_an_effect_is_grown_in_the_form_that_it_has(following: float) -> None:
    """How what sticks follows a level that changes late is of second order: a full fit tells it."""
    believed = stage(effects=[STRIBECK])
    late = {"name": "frictional-lag", "time_constant": 0.02, "following": following}
    recording = run(stage(effects=[STRIBECK, late]), there_and_back(16.0))
    balance = ForceBalance(believed, load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    found = look(fitter, base)
    grown = grow(fitter, base, found.candidates, found.screened, math.inf)
    best = min(grown, key=lambda model: model.sse).entries[0]
    assert best["name"] == "frictional-lag"
    assert best["following"] == following
    assert best["time_constant"] == pytest.approx(late["time_constant"], rel=0.1)
