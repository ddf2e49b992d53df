"""A name stands only where the stage that has it does what the fit says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.numerics.significance import Null
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.confidence import Alternatives
from rtcomp.diagnosis.search.selection import Search
from rtcomp.diagnosis.verdict.answer import answer
from rtcomp.diagnosis.verdict.validation import Reserved


@pytest.mark.parametrize(("times", "named"), [(1.0, True), (4.0, False)])
def test_a_stage_that_leaves_more_with_an_effect_names_none(times: float, named: bool) -> None:
    """Its mass is not that of the fit, as if the stage could not have it."""
    believed, wave = stage(), {"name": "cogging", "amplitude": 0.5, "period": 1e-4, "phase": 0.3}
    balance = ForceBalance(believed, load_data([run(stage(effects=[wave]), there_and_back(12.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    model = fitter.fit([Term.of(wave)], base)
    other = model.coefficients.copy()
    other[0] *= times
    chosen = replace(model, coefficients=other)
    null = Null(np.linspace(0.0, 0.01, 6), np.tile(model.errors, (6, 1)) * np.linspace(0.9, 1.1, 6)[:, None])
    sets = [Alternatives(chosen.terms[0], ("cogging",), 1.0, 0.9, (chosen,))]
    done = answer(believed, fitter, Search(base, chosen, null), sets, Reserved(balance), 0, math.inf)
    assert (done.verdict == "missing-physics") == named
    assert (done.verdict == "unexplained") != named
    assert any("a stage with it leaves more" in note for note in done.notes) != named
    assert done.fit.after <= done.fit.retuned
