"""Scans for a play: how it is found from afar, and where nothing is to be found."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from recorded import STAGE, run, stage, there_and_back

from rtcomp.diagnosis import clock
from rtcomp.diagnosis.candidates.excerpt import excerpt, moving
from rtcomp.diagnosis.candidates.growing import grow
from rtcomp.diagnosis.candidates.scanning import scanned
from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.selection import look
from rtcomp.stage.stage import Stage

PLAY = {"name": "backlash", "gap": 4e-6, "share": 0.35, "contact": 90.0}


@pytest.mark.parametrize("gap", [8e-7, 4e-6])
def test_how_the_load_meets_its_play_is_found_with_the_gap(gap: float) -> None:
    """A softer contact and another share than the catalogue's hide the gap: a wider one looks like them."""
    soft = {"name": "backlash", "gap": gap, "share": 0.45, "contact": 85.0}
    recording = run(
        Stage.from_dict({**STAGE, "stage": {**STAGE["stage"], "effects": [soft]}}), there_and_back(16.0)
    )
    balance = ForceBalance(stage(), load_data([recording]))
    fitter = Fitter(balance)
    found = look(fitter, baseline(balance))
    grown = grow(fitter, baseline(balance), found.candidates, found.screened, math.inf)
    best = min(grown, key=lambda model: model.sse).entries[0]
    assert best["name"] == "backlash"
    for name in ("gap", "share", "contact"):
        assert best[name] == pytest.approx(soft[name], rel=0.1)


@pytest.mark.parametrize("share", [0.2, 0.35, 0.75])
def test_from_where_a_scan_ends_a_fit_comes_to_gap_contact_and_share(share: float) -> None:
    """However far the share of the load is from the catalogue's 0.6."""
    believed, play = stage(), {"name": "backlash", "gap": 4e-6, "share": share, "contact": 140.0}
    recording = run(stage(effects=[play]), there_and_back(12.0))
    balance = ForceBalance(believed, load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    begun = Term.of({"name": "backlash", "gap": 1e-6})
    model = min(
        (fitter.fit([one], base) for one in scanned(fitter, base, begun, math.inf)), key=lambda m: m.sse
    )
    for name in ("gap", "contact", "share"):
        assert model.entries[0][name] == pytest.approx(play[name], rel=0.15)
    assert model.sse < 0.2 * base.sse
    assert scanned(fitter, base, begun, -math.inf) == []


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("seconds", [0.1, 0.5, 1.0])
def test_a_scan_that_runs_out_of_time_says_nothing_on_the_terminal(seconds: float) -> None:
    play = {"name": "backlash", "gap": 4e-6, "share": 0.35, "contact": 140.0}
    balance = ForceBalance(stage(), load_data([run(stage(effects=[play]), there_and_back(12.0))]))
    base, begun = baseline(balance), Term.of({"name": "backlash", "gap": 1e-6})
    assert len(scanned(Fitter(balance), base, begun, clock.now() + seconds)) <= 2


def test_a_scan_of_an_axis_without_play_finds_none_that_explains_it() -> None:
    balance = ForceBalance(stage(), load_data([run(stage(), there_and_back(12.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    begun = Term.of({"name": "backlash", "gap": 1e-6})
    terms = scanned(fitter, base, begun, math.inf)
    assert all(fitter.fit([term], base).sse > 0.9 * base.sse for term in terms)


def test_a_spring_and_a_weight_behind_a_play_are_fitted_with_it() -> None:
    """Where the load lies in its play goes by all forces on it, those found with the play among them."""
    spring, weight = {"name": "parallel-spring", "stiffness": 4e3}, {"name": "constant-force", "force": 0.9}
    axis = Stage.from_dict({**STAGE, "stage": {**STAGE["stage"], "effects": [PLAY, spring, weight]}})
    believed = Stage.from_dict({**STAGE, "stage": {**STAGE["stage"], "effects": [spring]}})
    balance = ForceBalance(believed, load_data([run(axis, there_and_back(16.0))]))
    fitter, base = Fitter(balance), baseline(balance)
    right = fitter.fit([Term(PLAY, frozenset()), Term.of(weight)], steps=0)
    begun = [Term.of({**PLAY, "gap": 3e-6}), Term.of({**weight, "force": 0.0})]
    found = fitter.fit(begun)
    assert found.entries[0]["gap"] == pytest.approx(PLAY["gap"], rel=0.05)
    assert found.entries[1]["force"] == pytest.approx(weight["force"], rel=0.05)
    assert right.sse < 1e-4 * base.sse and found.sse < 1e-3 * base.sse


def test_a_play_is_looked_for_where_the_axis_moves() -> None:
    """A drive that the friction of a thin belief does not hold leaves most where nothing moves."""
    reference = 1e-3 * np.interp(np.arange(24000) / 1000.0, [0.0, 5.0, 19.0, 24.0], [0.0, 1.0, 1.0, 2.0])
    recording = run(stage(), reference)
    balance = ForceBalance(stage(), load_data([recording]))
    base, fitter = baseline(balance), Fitter(balance)
    moves = moving(balance)[fitter.use]
    assert moves.any()
    assert not moves.all()
    most_at_rest = replace(base, errors=np.where(moves, 1.0, 1e6) * base.errors)
    part = excerpt(fitter, most_at_rest)
    assert part is not None
    assert moving(part.balance).all()
