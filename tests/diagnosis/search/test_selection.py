"""The search: what is grown beside what."""

from __future__ import annotations

import math

from recorded import run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.beam import in_other_forms

SINE = {"name": "cogging", "form": "sine", "amplitude": 0.1, "period": 1e-4, "phase": 0.4}
TRIANGLE = {**SINE, "form": "triangle"}
STRIBECK = {"name": "stribeck", "rise": 0.2, "velocity": 1e-3}


def test_no_effect_stands_beside_itself() -> None:
    """Another form of an effect is grown beside what stands beside the best, not beside that effect."""
    balance = ForceBalance(stage(), load_data([run(stage(effects=[SINE, STRIBECK]), there_and_back(12.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    best, other, beside = (fitter.fit([Term.of(e)], base) for e in (SINE, TRIANGLE, STRIBECK))
    twice = fitter.fit([*beside.terms, *best.terms], beside)
    assert in_other_forms(fitter, best, [other], [twice], math.inf) == []
    larger = fitter.fit([*best.terms, *beside.terms], best)
    grown = in_other_forms(fitter, best, [other], [twice, larger], math.inf)
    assert [[e["name"] for e in m.entries] for m in grown] == [["cogging", "stribeck"]]
