"""Models that could stand in the place of the chosen one."""

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


def test_a_hysteresis_bent_to_a_function_of_the_position_may_be_a_spring() -> None:
    """A spring that softens as an exponential: Bouc-Wen's equation without a loop has that very law."""
    axis = stage()
    recording = run(axis, there_and_back(20.0))
    x = recording.position / np.abs(recording.position).max()
    noise = 0.05 * np.random.default_rng(1).standard_normal(x.size)
    force = 0.5 * np.sign(x) * -np.expm1(-3.0 * np.abs(x)) + noise
    pushed = {**recording.columns, "voltage": recording.voltage + force}
    balance = ForceBalance(axis, load_data([replace(recording, columns=pushed)]))
    base, fitter = baseline(balance), Fitter(balance)
    length = float(np.abs(recording.position).max())
    bent = {"name": "bouc-wen", "alpha": 6.0 / length, "beta": 30.0 / length, "gamma": 0.0, "delta": 0.1}
    chosen = fitter.fit([Term(bent, frozenset({"alpha", "beta"}))], base)
    spring = fitter.fit([Term.of({"name": "parallel-spring", "stiffness": 1.0 / length, "cubic": 1e3})], base)
    told = alternatives(fitter, Search(base, chosen, alternatives=[spring]), math.inf)[0]
    assert set(told.names) == {"bouc-wen", "parallel-spring"}


def test_a_hysteresis_with_a_loop_is_none() -> None:
    axis = stage()
    loop = {"name": "bouc-wen", "alpha": 6e3, "beta": 1e4, "gamma": 0.5, "delta": -0.5}
    balance = ForceBalance(axis, load_data([run(stage(effects=[loop]), there_and_back(20.0))]))
    base, fitter = baseline(balance), Fitter(balance)
    chosen = fitter.fit([Term(loop, frozenset({"alpha"}))], base)
    spring = fitter.fit([Term.of({"name": "parallel-spring", "stiffness": 6e3, "cubic": 1e9})], base)
    told = alternatives(fitter, Search(base, chosen, alternatives=[spring]), math.inf)[0]
    assert told.names == ("bouc-wen",)
