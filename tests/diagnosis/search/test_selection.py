"""The search: what is grown beside what."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from recorded import RATE, run, stage, there_and_back

from rtcomp.diagnosis import clock
from rtcomp.diagnosis import entries as ent
from rtcomp.diagnosis.candidates.screening import Look, Screen, look
from rtcomp.diagnosis.fitting.baseline import baseline, settle
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.fitted import Fitted
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search import selection
from rtcomp.diagnosis.search.beam import grown_further, in_other_forms, with_two
from rtcomp.diagnosis.search.selection import Search, search
from rtcomp.diagnosis.verdict.answer import Rest
from rtcomp.physics import catalogue

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


def test_an_effect_that_compensates_for_another_is_fitted_again_beside_it() -> None:
    """A fall of friction with speed ten times too large takes up what a spring does."""
    reaches = np.array([1.5e-6, 3.5e-6, 7e-6, 1.3e-5, 2.4e-5, 4e-5])
    friction = [{"stiffness": 0.7 / r, "reach": r} for r in reaches.tolist()]
    fall = {"name": "stribeck", "form": "gaussian", "rise": 0.41, "velocity": 9.2e-4}
    spring = {"name": "parallel-spring", "stiffness": 2390.0}
    t = np.arange(8.0 * RATE) / RATE
    waves = 6e-4 * np.sin(1.95 * t) + 1.5e-4 * np.sin(8.2 * t + 1.0) + 6e-5 * np.sin(19.5 * t)
    recording = run(stage(friction=friction, effects=[fall, spring]), (1.0 - np.exp(-2.0 * t)) * waves)
    balance = ForceBalance(stage(friction=friction), load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    alone = look(fitter, base, without=[k.name for k in catalogue.entries() if k.name != "stribeck"])
    start = {"name": "stribeck", "form": "root", "rise": 5.0, "velocity": 8e-3}
    bent = fitter.fit([Term.of(start)], base)
    settle(fitter, bent.terms)
    bent, other = fitter.fit(bent.terms, bent), fitter.fit([Term.of(spring)], base)
    assert bent.sse < 0.2 * other.sse
    assert fitter.fit([*bent.terms, *other.terms], bent).sse > 0.5 * bent.sse
    nothing = Look([], [], Screen([], fitter))
    grown, cut = grown_further(fitter, [bent, other], nothing, alone, math.inf)
    best = min(grown, key=lambda model: model.sse)
    assert not cut and best.sse < 0.1 * bent.sse
    (_, found) = best.entries
    assert abs(found["rise"] - 0.41) < 0.03 and abs(found["velocity"] - 9.2e-4) < 5e-5


def test_a_large_event_and_what_it_hides_are_found_together() -> None:
    """Alone neither explains much of most blocks: the reading jumps once; the lag shows beside it only."""
    jump, lag = {"size": 6e-5, "time": 5.0}, {"time_constant": 4e-3}
    there = [{"name": "sensor-jump", **jump}, {"name": "drive-lag", **lag}]
    balance = ForceBalance(stage(), load_data([run(stage(effects=there), there_and_back(12.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    found = search(fitter, base, math.inf, lambda _part, _what: None)
    assert sorted(term.entry["name"] for term in found.chosen.terms) == ["drive-lag", "sensor-jump"]
    assert found.chosen.sse < 1e-2 * base.sse


def test_of_two_that_pass_only_together_both_are_found() -> None:
    """What leaves least is tried with each further effect where none passes the test alone."""
    fall = {"name": "stribeck", "rise": 0.4, "velocity": 1.5e-3}
    there = [
        {"name": "frictional-lag", "time_constant": 0.02, "following": 1.0},
        {"name": "sensor-delay", "delay": 1e-3},
    ]
    recording = run(stage(effects=[fall, *there]), there_and_back(12.0))
    balance = ForceBalance(stage(effects=[fall]), load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    others = [k.name for k in catalogue.entries() if k.name not in ("frictional-lag", "sensor-delay")]
    seen = look(fitter, base, without=others)
    grown, _ = grown_further(fitter, [base], seen, seen, math.inf)
    best = min(with_two(fitter, base, seen, grown, math.inf), key=lambda model: model.sse)
    assert sorted(e["name"] for e in best.entries) == ["frictional-lag", "sensor-delay"]
    assert best.sse < 0.02 * base.sse < min(model.sse for model in grown)
    assert not with_two(fitter, best, seen, [best], math.inf)


@pytest.mark.parametrize(("effects", "missing"), [([], False), ([{**SINE, "amplitude": 0.01}], True)])
def test_without_time_for_effects_what_is_missing_is_said_to_be(
    effects: list[dict[str, Any]], missing: bool
) -> None:
    """A wave of less than a hundredth of the force, which may be left where it could not be named."""
    recording = run(stage(effects=effects), there_and_back(12.0))
    balance = ForceBalance(stage(), load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    assert fitter.relative(base, seen=True) < 0.01
    found = search(fitter, base, clock.now(), lambda _part, _what: None)
    assert found.chosen is base and found.cut_short is missing
    assert Rest.of(fitter, found).significant is missing


def test_what_is_not_sound_does_not_stand_in_the_place_of_what_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """A delay of the drive that its own replicates deny is no other explanation of one of the sensor."""
    delay = {"name": "drive-delay", "delay": 4e-3}
    data = load_data([run(stage(effects=[delay]), there_and_back(8.0))])

    def found() -> list[set[str]]:
        balance = ForceBalance(stage(), data)
        base = baseline(balance)
        done = search(Fitter(balance), base, math.inf, lambda _part, _what: None)
        return [set(ent.names(m.entries)) for m in (done.chosen, *done.alternatives)]

    chosen, *others = found()
    (name,) = chosen
    assert others
    unsound = selection.sound

    def denied(seen: Look, model: Fitted, parent: float, before: Search) -> Look | None:
        return None if name in ent.names(model.entries) else unsound(seen, model, parent, before)

    monkeypatch.setattr(selection, "sound", denied)
    assert all(name not in names for names in found())
