"""Models that could stand in the place of the chosen one."""

from __future__ import annotations

import math
from typing import Any

import pytest
from recorded import run, stage, there_and_back

from rtcomp.diagnosis.fitting.baseline import baseline
from rtcomp.diagnosis.fitting.fit import Fitter
from rtcomp.diagnosis.fitting.free import Term
from rtcomp.diagnosis.forces.balance import ForceBalance
from rtcomp.diagnosis.recordings.data import load_data
from rtcomp.diagnosis.search.confidence import alternatives
from rtcomp.diagnosis.search.selection import Search


@pytest.mark.parametrize(("name", "most"), [("drive-offset", 0.5), ("constant-force", 0.6)])
def test_of_two_as_plain_the_better_is_chosen(name: str, most: float) -> None:
    """Beside a limit of the drive an offset is another force than a constant one, whichever came first."""
    limit = {"name": "drive-saturation", "limit": most}
    pushes = {"drive-offset": {"offset": 0.15}, "constant-force": {"force": 0.6}}
    there = [limit, {"name": name, **pushes[name]}]
    balance = ForceBalance(stage(), load_data([run(stage(effects=there), there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    models = {
        other: fitter.fit([Term.of(limit), Term.of({"name": other, **size})], base)
        for other, size in pushes.items()
    }
    wrong = next(model for other, model in models.items() if other != name)
    found = Search(base, wrong, alternatives=[models[name]])
    sets = alternatives(fitter, found, math.inf)
    assert [one.names[0] for one in sets] == ["drive-saturation", name]
    assert sets[1].probability > 0.95


PUSHES: list[dict[str, Any]] = [
    {"name": "constant-force", "force": 0.6},
    {"name": "drive-offset", "offset": 0.15},
]


@pytest.mark.parametrize("first", PUSHES)
def test_of_two_that_do_the_same_the_one_in_the_stage_comes_first(first: dict[str, Any]) -> None:
    """The parameters that are told are of that one."""
    balance = ForceBalance(stage(), load_data([run(stage(effects=PUSHES[:1]), there_and_back(12.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    chosen, other = (fitter.fit([Term.of(e)], base) for e in sorted(PUSHES, key=lambda e: e is not first))
    (told,) = alternatives(fitter, Search(base, chosen, alternatives=[other]), math.inf)
    assert told.names == (first["name"], other.entries[0]["name"])
